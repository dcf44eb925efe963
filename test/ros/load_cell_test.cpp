#include <cmath>

#include <geometry_msgs/WrenchStamped.h>

#include "test_support.h"

namespace brash_ice_rig {
namespace {

/// Mean and standard deviation of force.z, N.
struct Spread {
  explicit Spread(const std::vector<geometry_msgs::WrenchStamped>& messages) {
    for (const auto& message : messages) mean += message.wrench.force.z / static_cast<double>(messages.size());
    double sum = 0.0;
    for (const auto& message : messages) sum += std::pow(message.wrench.force.z - mean, 2.0);
    deviation = std::sqrt(sum / static_cast<double>(messages.size()));
  }
  double mean = 0.0, deviation = 0.0;
};

std::vector<geometry_msgs::WrenchStamped> listen(const char* topic, std::size_t count) {
  Listener<geometry_msgs::WrenchStamped> listener(topic);
  EXPECT_TRUE(waitFor([&] { return listener.messages.size() >= count; }));
  return listener.messages;
}

// The rig of load_cell_test.test hangs still; its cell has 20 N of noise and a bias of 500 N.
TEST(LoadCell, NoiseAndBiasAreInTheReadingOnly) {
  const Spread reading(listen("load_cell/wrench", 200));
  const Spread truth(listen("ground_truth/wrench", 100));
  EXPECT_NEAR(reading.deviation, 20.0, 4.0);
  EXPECT_LT(truth.deviation, 1.0);
  EXPECT_NEAR(reading.mean - truth.mean, 500.0, 8.0);
}

TEST(LoadCell, TareMakesThePresentReadingZero) {
  ASSERT_GT(Spread(listen("load_cell/wrench", 50)).mean, 1000.0);
  const auto answer = callTrigger("load_cell/tare");
  EXPECT_TRUE(answer.success) << answer.message;
  spinFor(0.1);
  EXPECT_NEAR(Spread(listen("load_cell/wrench", 200)).mean, 0.0, 8.0);
  EXPECT_GT(Spread(listen("ground_truth/wrench", 50)).mean, 1000.0) << "the truth is not tared";
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "load_cell_test");
}
