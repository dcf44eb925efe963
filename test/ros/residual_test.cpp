#include <cmath>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include <geometry_msgs/WrenchStamped.h>

#include "brash_ice_rig/CraneState.h"
#include "brash_ice_rig/ForceResidual.h"
#include "test_support.h"

namespace brash_ice_rig {
namespace {

/// Publishes a test: simulated force at 50 Hz, and a measured one that is the same with white noise of 40 N. Ten
/// seconds at rest, then a lift from 2 to 5 kN. Faster than real time.
class Residual : public testing::Test {
 protected:
  void SetUp() override {
    measured_publisher_ = node_.advertise<geometry_msgs::WrenchStamped>("measured/wrench", 1000);
    simulated_publisher_ = node_.advertise<geometry_msgs::WrenchStamped>("load_cell/wrench", 1000);
    crane_publisher_ = node_.advertise<CraneState>("crane/state", 10);
    ASSERT_TRUE(connected());
    ASSERT_TRUE(residual_.waitForConnection());
  }

  bool connected() {
    return waitFor([this] {
      return measured_publisher_.getNumSubscribers() > 0 && simulated_publisher_.getNumSubscribers() > 0 &&
             crane_publisher_.getNumSubscribers() > 0;
    });
  }

  void publish(double start_s, double end_s, double step_at_s = 1e9, bool measured = true) {
    for (int i = static_cast<int>(std::lround(50.0 * start_s)); i < static_cast<int>(std::lround(50.0 * end_s)); ++i) {
      const double t = 0.02 * i;
      geometry_msgs::WrenchStamped wrench;
      wrench.header.stamp.fromSec(100.0 + t);
      const double lifted_s = std::max(0.0, t - 12.0);
      wrench.wrench.force.z = 2000.0 + 3000.0 * std::min(1.0, lifted_s / 20.0);
      simulated_publisher_.publish(wrench);
      CraneState state;
      state.velocity_mps.z = t > 12.0 ? 0.1 : 0.0;
      if (i % 5 == 0) crane_publisher_.publish(state);
      wrench.wrench.force.z += 40.0 * normal_(generator_) + (t >= step_at_s ? 1000.0 : 0.0);
      if (measured) measured_publisher_.publish(wrench);
      if (i % 10 == 9) spinFor(0.004);
    }
    spinFor(0.5);
  }

  const ForceResidual& last() const { return residual_.last(); }

  ros::NodeHandle node_;
  ros::Publisher measured_publisher_, simulated_publisher_, crane_publisher_;
  Listener<ForceResidual> residual_{"measured/residual"};
  std::mt19937 generator_{7};
  std::normal_distribution<double> normal_;
};

TEST_F(Residual, SaysWhichTopicIsMissing) {
  ASSERT_TRUE(residual_.waitForNew([](const ForceResidual& message) {
    return message.state == "waiting" &&
           message.text.find("/measured/wrench nor on /load_cell/wrench") != std::string::npos;
  }));
  bool found = false;
  for (int i = 0; i < 8 && !found; ++i) {
    publish(i, i + 0.5, 1e9, false);
    for (const auto& message : residual_.messages) {
      found = found || message.text.find("no messages on /measured/wrench: ") == 0;
    }
  }
  EXPECT_TRUE(found);
  EXPECT_TRUE(std::isnan(last().residual_n));
}

TEST_F(Residual, NoiseIsNotSignificantAndAStepOfAKilonewtonIsWithinASecond) {
  ASSERT_TRUE(callTrigger("residual_node/restart").success);
  publish(0.0, 40.0);
  ASSERT_EQ(last().state, "not_significant") << last().text;
  std::size_t learning = 0;
  for (const auto& message : residual_.messages) {
    EXPECT_FALSE(message.significant) << message.header.stamp;
    if (message.state == "learning") ++learning;
  }
  EXPECT_NEAR(static_cast<double>(learning), 40.0, 1.0) << "10 s at 4 Hz";
  // Means of 12 or 13 values with 40 N each.
  EXPECT_NEAR(std::hypot(last().white_noise_n, last().slow_noise_n), 40.0 / std::sqrt(12.5), 4.0);
  EXPECT_TRUE(last().noise_estimated);
  EXPECT_EQ(last().late_messages, 0u);

  publish(40.0, 45.0, 42.0);
  EXPECT_EQ(last().state, "significant");
  EXPECT_EQ(last().text, "significant: run brash_ice identify on the record");
  EXPECT_GT(last().significant_since_s, 142.0);
  EXPECT_LT(last().significant_since_s, 143.0);
  EXPECT_NEAR(last().residual_n, 1000.0, 60.0);

  // Another run, with the noise of before, although its hoist moves already.
  const double white_noise_n = last().white_noise_n;
  publish(20.0, 30.0);
  EXPECT_EQ(last().state, "not_significant") << "stamps went back: " << last().text;
  EXPECT_EQ(last().white_noise_n, white_noise_n);

  // The node dies amid a lift, and roslaunch starts it again.
  ASSERT_EQ(std::system("rosnode kill /residual_node >/dev/null 2>&1"), 0);
  ASSERT_TRUE(waitFor([this] { return measured_publisher_.getNumSubscribers() == 0; }));
  ASSERT_TRUE(connected());
  spinFor(0.5);
  const std::size_t before = residual_.messages.size();
  publish(30.0, 36.0, 33.0);
  ASSERT_GT(residual_.messages.size(), before);
  EXPECT_NEAR(last().white_noise_n, white_noise_n, 1e-9);
  EXPECT_EQ(last().state, "significant") << last().text;
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "residual_test");
}
