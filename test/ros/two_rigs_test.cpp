#include <geometry_msgs/TwistStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <rosgraph_msgs/Clock.h>

#include "brash_ice_rig/CraneState.h"
#include "test_support.h"

namespace brash_ice_rig {
namespace {

TEST(TwoRigs, EachHasItsOwnTopicsAndFrames) {
  Listener<geometry_msgs::WrenchStamped> east("east/load_cell/wrench"), west("west/load_cell/wrench");
  ASSERT_TRUE(east.waitForNew());
  ASSERT_TRUE(west.waitForNew());
  EXPECT_EQ(east.last().header.frame_id, "east/load_cell");
  EXPECT_EQ(west.last().header.frame_id, "west/load_cell");
}

TEST(TwoRigs, ACommandMovesOnlyItsRig) {
  Listener<CraneState> east("east/crane/state"), west("west/crane/state");
  ASSERT_TRUE(east.waitForNew());
  ASSERT_TRUE(west.waitForNew());
  const double east_m = east.last().position_m.z, west_m = west.last().position_m.z;
  ros::NodeHandle node;
  auto publisher = node.advertise<geometry_msgs::TwistStamped>("west/crane/cmd_vel", 1);
  geometry_msgs::TwistStamped command;
  command.header.frame_id = "west/crane_tip";
  command.twist.linear.z = -0.2;
  EXPECT_TRUE(waitFor([&] {
    publisher.publish(command);
    ros::WallDuration(0.05).sleep();
    return west.last().position_m.z < west_m - 0.1;
  }));
  ASSERT_TRUE(east.waitForNew());
  EXPECT_EQ(east.last().position_m.z, east_m);
}

TEST(TwoRigs, ResetOfOneLeavesTheOther) {
  Listener<SimStatus> east("east/sim/status");
  ASSERT_TRUE(east.waitForNew([](const SimStatus& s) { return s.time_s > 0.0; }));
  const std::uint64_t steps = east.last().step_count;
  ASSERT_TRUE(callTrigger("west/rig_node/reset").success);
  ASSERT_TRUE(east.waitForNew());
  EXPECT_GE(east.last().step_count, steps);
}

TEST(TwoRigs, OneClock) {
  Listener<rosgraph_msgs::Clock> clock("/clock");
  ASSERT_TRUE(waitFor([&] { return clock.messages.size() > 100; }));
  for (std::size_t i = 1; i < clock.messages.size(); ++i) {
    ASSERT_GT(clock.messages[i].clock, clock.messages[i - 1].clock);
  }
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "two_rigs_test");
}
