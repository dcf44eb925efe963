#include <algorithm>
#include <cmath>

#include <geometry_msgs/WrenchStamped.h>

#include "brash_ice_rig/ForceComponents.h"
#include "test_support.h"

namespace brash_ice_rig {
namespace {

// One run of small.yaml in real time, heard from the start: settle until 0, then 1 s of free water, then the lift.
class Wrench : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    wrench = new Listener<geometry_msgs::WrenchStamped>("load_cell/wrench");
    truth = new Listener<geometry_msgs::WrenchStamped>("ground_truth/wrench");
    components = new Listener<ForceComponents>("ground_truth/force_components");
    ASSERT_TRUE(wrench->waitForNew());
    ASSERT_TRUE(components->waitForNew([](const ForceComponents& c) { return c.time_s >= 3.5; }, 30.0));
  }
  static void TearDownTestSuite() {
    delete wrench;
    delete truth;
    delete components;
  }

  static const ForceComponents& componentsAt(double time_s) {
    return *std::find_if(components->messages.begin(), components->messages.end(),
                         [&](const ForceComponents& c) { return c.time_s > time_s - 1e-6; });
  }

  static Listener<geometry_msgs::WrenchStamped>*wrench, *truth;
  static Listener<ForceComponents>* components;
};

Listener<geometry_msgs::WrenchStamped>* Wrench::wrench = nullptr;
Listener<geometry_msgs::WrenchStamped>* Wrench::truth = nullptr;
Listener<ForceComponents>* Wrench::components = nullptr;

TEST_F(Wrench, ComesAt100HzOfSimulatedTime) {
  ASSERT_GT(wrench->messages.size(), 200u);
  for (std::size_t i = 1; i < wrench->messages.size(); ++i) {
    const double step_s = (wrench->messages[i].header.stamp - wrench->messages[i - 1].header.stamp).toSec();
    ASSERT_NEAR(step_s, 0.01, 1e-6) << "at sample " << i;
  }
}

TEST_F(Wrench, ComesAt100HzOfWallTimeAtRealTimeFactor1) {
  const double duration_s = wrench->arrivals_s.back() - wrench->arrivals_s.front();
  ASSERT_GT(duration_s, 2.0);
  EXPECT_NEAR(static_cast<double>(wrench->messages.size() - 1) / duration_s, 100.0, 1.0);
}

TEST_F(Wrench, IsInTheLoadCellsFrameWithoutTorque) {
  for (const auto& message : wrench->messages) {
    ASSERT_EQ(message.header.frame_id, "load_cell");
    ASSERT_EQ(message.wrench.torque.x, 0.0);
    ASSERT_EQ(message.wrench.torque.y, 0.0);
    ASSERT_EQ(message.wrench.torque.z, 0.0);
  }
}

// 190 kg of steel, of which the collector and the pole below the waterline displace water; nothing touches the ice yet.
TEST_F(Wrench, HangingRigReadsItsWeightLessItsBuoyancy) {
  const ForceComponents& hanging = componentsAt(-0.5);
  const double pole_section_m2 = M_PI * 0.05 * 0.05;
  const double hub_depth_m = 1.08 + 0.3 + 0.1;
  const double expected_n = 9.81 * (190.0 - 1000.0 * (0.02 + pole_section_m2 * hub_depth_m));
  EXPECT_NEAR(hanging.tension_n, expected_n, 1.0);
  EXPECT_NEAR(hanging.weight_n, 9.81 * 190.0, 0.01);
  const auto at_that_stamp = std::find_if(wrench->messages.begin(), wrench->messages.end(), [&](const auto& message) {
    return message.header.stamp == hanging.header.stamp;
  });
  ASSERT_NE(at_that_stamp, wrench->messages.end());
  EXPECT_NEAR(at_that_stamp->wrench.force.z, expected_n, 1.0);
}

TEST_F(Wrench, PullOnTheCraneIsPositiveAndRisesInTheLift) {
  const double hanging_n = componentsAt(-0.5).tension_n;
  EXPECT_GT(hanging_n, 0.0);
  EXPECT_GT(componentsAt(3.0).tension_n, hanging_n + 1000.0);
  EXPECT_LT(componentsAt(3.0).ice_force_n.z, -1000.0) << "the ice presses down on the net";
}

TEST_F(Wrench, TrueWrenchIsTheSumOfTheComponents) {
  for (std::size_t i = 0; i < components->messages.size(); i += 25) {
    const ForceComponents& c = components->messages[i];
    const double sum_n = c.weight_n - c.buoyancy_n + c.ice_normal_n + c.ice_friction_n + c.inertia_n;
    ASSERT_NEAR(c.tension_n, sum_n, 1e-6);
    const auto same = std::find_if(truth->messages.begin(), truth->messages.end(),
                                   [&](const auto& message) { return message.header.stamp == c.header.stamp; });
    if (same == truth->messages.end()) continue;  // heard before the other subscription stood
    ASSERT_NEAR(same->wrench.force.z, sum_n, 1e-6);
  }
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "wrench_test");
}
