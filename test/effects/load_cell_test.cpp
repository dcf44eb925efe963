#include <cmath>

#include <gtest/gtest.h>

#include "brash_ice_rig/simulation/simulation.h"
#include "effect_bench.h"

namespace brash_ice_rig {
namespace {

constexpr double kStep = 0.0025;

Eigen::Vector3d reading(Effect& effect, double time_s, Eigen::Vector3d force_n) {
  effect.updateReading(time_s, kStep, force_n);
  return force_n;
}

TEST(LoadCellLag, StepResponseIs63PercentAfterTau) {
  const auto lag = makeEffect("load_cell_lag", {{"lag_s", 0.5}});
  reading(*lag, 0.0, {0.0, 0.0, 1000.0});  // the sensor begins in equilibrium
  Eigen::Vector3d now;
  for (int k = 1; k <= 200; ++k) now = reading(*lag, k * kStep, {100.0, 0.0, 3000.0});
  EXPECT_NEAR(now.z(), 1000.0 + 2000.0 * (1.0 - std::exp(-1.0)), 1e-6);
  EXPECT_NEAR(now.x(), 100.0 * (1.0 - std::exp(-1.0)), 1e-6);
}

TEST(LoadCellLag, FollowsARampByTauBehind) {
  const auto lag = makeEffect("load_cell_lag", {{"lag_s", 0.2}});
  Eigen::Vector3d now;
  for (int k = 0; k <= 2000; ++k) now = reading(*lag, k * kStep, {0.0, 0.0, 500.0 * k * kStep});
  EXPECT_NEAR(now.z(), 500.0 * (5.0 - 0.2), 0.5 * 500.0 * kStep + 1e-6);  // a step sees its end's force throughout
}

TEST(LoadCellScale, MultipliesAllAxes) {
  const auto scale = makeEffect("load_cell_scale", {{"error_ratio", 0.09}});
  EXPECT_TRUE(reading(*scale, 1.0, {10.0, -20.0, 5000.0}).isApprox(Eigen::Vector3d(10.9, -21.8, 5450.0), 1e-14));
}

TEST(LoadCellDrift, GrowsWithTheMinutesSinceTimeZero) {
  const auto drift = makeEffect("load_cell_drift", {{"rate_n_per_min", 274.0}});
  EXPECT_NEAR(reading(*drift, 30.0, {0.0, 0.0, 5000.0}).z(), 5137.0, 1e-9);
  EXPECT_EQ(reading(*drift, -2.0, {0.0, 0.0, 5000.0}).z(), 5000.0);
}

TEST(LoadCellBias, IsAddedToTheTensionOnly) {
  const auto bias = makeEffect("load_cell_bias", {{"bias_n", -136.0}});
  EXPECT_EQ(reading(*bias, 1.0, {1.0, 2.0, 5000.0}), Eigen::Vector3d(1.0, 2.0, 4864.0));
}

TEST(LoadCellErrors, MakeScaledLaggedForcePlusDriftPlusBiasAndLeaveTheTruth) {
  Scenario s = rigInTheAir();
  enable(s, "load_cell_scale", {{"error_ratio", 0.1}});
  enable(s, "load_cell_drift", {{"rate_n_per_min", 60.0}});
  enable(s, "load_cell_bias", {{"bias_n", 50.0}});
  enable(s, "load_cell_lag", {{"lag_s", 0.1}});
  Simulation simulation(s);
  simulation.advance(2.5);
  const double weight = 240.0 * 9.81;
  EXPECT_NEAR(simulation.snapshot().tension_n, weight, 1e-9);
  EXPECT_NEAR(simulation.snapshot().force_n, 1.1 * weight + 1.0 * 2.0 + 50.0, 1e-6);
  simulation.tare();
  simulation.advance(0.01);
  EXPECT_NEAR(simulation.snapshot().force_n, 0.0, 0.02) << "taring takes bias and drift so far away";
}

}  // namespace
}  // namespace brash_ice_rig
