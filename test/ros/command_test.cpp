#include <cmath>
#include <cstring>
#include <limits>

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <geometry_msgs/TwistStamped.h>
#include <std_msgs/Float64.h>

#include "brash_ice_rig/CraneState.h"
#include "test_support.h"

namespace brash_ice_rig {
namespace {

geometry_msgs::TwistStamped makeCommand(double z_mps) {
  geometry_msgs::TwistStamped command;
  command.header.frame_id = "crane_tip";
  command.twist.linear.z = z_mps;
  return command;
}

// The node of command_test.test is in manual control and may lower the crane tip to 3.5 m.
class Command : public testing::Test {
 protected:
  void SetUp() override {
    publisher_ = node_.advertise<geometry_msgs::TwistStamped>("crane/cmd_vel", 1);
    ASSERT_TRUE(waitFor([&] { return publisher_.getNumSubscribers() > 0; }));
    ASSERT_TRUE(callTrigger("rig_node/reset").success);
    ASSERT_TRUE(crane_.waitForNew([](const CraneState& state) { return state.stage == "manual"; }));
    ASSERT_TRUE(status_.waitForNew([](const SimStatus& s) { return !hasFlag(s, SimStatus::MULTIPLE_COMMANDERS); }));
  }

  void TearDown() override { publisher_.publish(makeCommand(0.0)); }

  /// Repeats a command at 20 Hz until the condition holds.
  bool driveUntil(const geometry_msgs::TwistStamped& command, const std::function<bool()>& condition,
                  double timeout_s = 10.0) {
    for (double waited_s = 0.0; waited_s < timeout_s; waited_s += 0.05) {
      publisher_.publish(command);
      if (waitFor(condition, 0.05)) return true;
    }
    return false;
  }

  bool flagged(std::uint32_t flag) { return !status_.messages.empty() && hasFlag(status_.last(), flag); }
  double speed() { return crane_.last().velocity_mps.z; }
  double height() { return crane_.last().position_m.z; }

  ros::NodeHandle node_;
  ros::Publisher publisher_;
  Listener<CraneState> crane_{"crane/state"};
  Listener<SimStatus> status_{"sim/status"};
};

TEST_F(Command, CraneFollowsItAndTheExecutedOneIsPublished) {
  Listener<geometry_msgs::TwistStamped> executed("crane/cmd_vel_out");
  ASSERT_TRUE(executed.waitForConnection());
  EXPECT_TRUE(driveUntil(makeCommand(-0.1), [&] {
    return std::abs(speed() + 0.1) < 1e-9 && !executed.messages.empty() &&
           std::abs(executed.last().twist.linear.z + 0.1) < 1e-9;
  }));
  EXPECT_EQ(executed.last().header.frame_id, "crane_tip");
}

TEST_F(Command, SidewaysMovesTheBoom) {
  auto command = makeCommand(0.0);
  command.twist.linear.x = 0.1;
  EXPECT_TRUE(driveUntil(command, [&] { return crane_.last().position_m.x > 0.05; }));
  EXPECT_NEAR(crane_.last().position_m.y, 0.0, 1e-9);
}

TEST_F(Command, StaleCommandStopsTheCrane) {
  ASSERT_TRUE(driveUntil(makeCommand(-0.1), [&] { return speed() < -0.09; }));
  const double last_command_s = crane_.last().time_s;
  ASSERT_TRUE(waitFor([&] { return speed() == 0.0; }));
  // Timeout 0.25 s, then the ramp from 0.1 m/s at 0.5 m/s2; states come every 0.1 s.
  EXPECT_NEAR(crane_.last().time_s - last_command_s, 0.25 + 0.2, 0.25);
  EXPECT_TRUE(waitFor([&] { return flagged(SimStatus::COMMAND_TIMEOUT); }));
  const double rest_m = height();
  spinFor(0.5);
  EXPECT_EQ(height(), rest_m);
}

TEST_F(Command, NonFiniteIsRefusedAndStopsTheCrane) {
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    ASSERT_TRUE(driveUntil(makeCommand(-0.1), [&] { return speed() < -0.05; }));
    EXPECT_TRUE(driveUntil(makeCommand(bad), [&] { return speed() == 0.0; }));
    EXPECT_TRUE(driveUntil(makeCommand(bad), [&] { return flagged(SimStatus::COMMAND_REJECTED); }));
    EXPECT_TRUE(std::isfinite(height()));
  }
}

TEST_F(Command, ForeignFrameIsRefused) {
  auto command = makeCommand(-0.1);
  command.header.frame_id = "base_link";
  EXPECT_TRUE(driveUntil(command, [&] { return flagged(SimStatus::COMMAND_REJECTED); }));
  EXPECT_EQ(speed(), 0.0);
}

TEST_F(Command, TooLargeIsCutToTheSpeedLimit) {
  Listener<geometry_msgs::TwistStamped> executed("crane/cmd_vel_out");
  ASSERT_TRUE(executed.waitForConnection());
  EXPECT_TRUE(driveUntil(makeCommand(-1e300), [&] { return flagged(SimStatus::SPEED_LIMITED); }));
  EXPECT_TRUE(waitFor([&] { return !executed.messages.empty(); }));
  for (const auto& message : executed.messages) EXPECT_GE(message.twist.linear.z, -0.5);
  for (const auto& state : crane_.messages) EXPECT_GE(state.velocity_mps.z, -0.5);
}

TEST_F(Command, TravelEndsAtTheLimit) {
  EXPECT_TRUE(driveUntil(makeCommand(-0.4), [&] { return flagged(SimStatus::TRAVEL_LIMIT) && speed() == 0.0; }));
  EXPECT_NEAR(height(), 3.5, 1e-3);
  EXPECT_GE(height(), 3.5);
}

TEST_F(Command, FoldFollowsItsCommandAndRefusesNonsense) {
  auto fold = node_.advertise<std_msgs::Float64>("collector/cmd_fold", 1);
  ASSERT_TRUE(waitFor([&] { return fold.getNumSubscribers() > 0; }));
  const double open_rad = crane_.last().arm_angle_rad;
  std_msgs::Float64 target;
  target.data = 0.9;
  fold.publish(target);
  EXPECT_TRUE(waitFor([&] { return std::abs(crane_.last().fold_ratio - 0.9) < 1e-6; }));
  EXPECT_GT(crane_.last().arm_angle_rad, open_rad);
  target.data = 7.0;
  fold.publish(target);
  EXPECT_TRUE(waitFor([&] { return flagged(SimStatus::COMMAND_REJECTED); }));
  EXPECT_NEAR(crane_.last().fold_target, 0.9, 1e-9);
}

// The second publisher must be another process: ROS merges those of one node.
TEST_F(Command, SecondPublisherStopsTheCraneUntilItIsGone) {
  ASSERT_TRUE(driveUntil(makeCommand(-0.05), [&] { return speed() < -0.04; }));
  char program[] = "/proc/self/exe", role[] = "--second-publisher";
  char* const arguments[] = {program, role, nullptr};
  pid_t child = 0;
  ASSERT_EQ(posix_spawn(&child, program, nullptr, nullptr, arguments, environ), 0);
  EXPECT_TRUE(driveUntil(makeCommand(-0.05), [&] { return flagged(SimStatus::MULTIPLE_COMMANDERS); }));
  EXPECT_TRUE(driveUntil(makeCommand(-0.05), [&] { return speed() == 0.0; }));
  const double rest_m = height();
  EXPECT_FALSE(driveUntil(
      makeCommand(-0.05), [&] { return height() != rest_m; }, 0.5))
      << "neither is obeyed";
  kill(child, SIGTERM);
  waitpid(child, nullptr, 0);
  EXPECT_TRUE(driveUntil(makeCommand(-0.05), [&] { return speed() < -0.04; })) << "alone again, it is obeyed";
}

int actAsSecondPublisher(int argc, char** argv) {
  ros::init(argc, argv, "second_publisher");
  ros::NodeHandle node;
  auto publisher = node.advertise<geometry_msgs::TwistStamped>("crane/cmd_vel", 1);
  while (ros::ok()) {
    publisher.publish(makeCommand(-0.5));
    ros::WallDuration(0.05).sleep();
  }
  return 0;
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  if (argc >= 2 && std::strcmp(argv[1], "--second-publisher") == 0) {
    return brash_ice_rig::actAsSecondPublisher(argc, argv);
  }
  return brash_ice_rig::runRosTest(argc, argv, "command_test");
}
