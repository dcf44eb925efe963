#include "brash_ice_rig/rig/load_cell.h"

#include <cmath>

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

const Eigen::Vector3d kForce(10.0, -20.0, 5000.0);

TEST(LoadCell, WithoutErrorsReadsTheTruth) {
  LoadCell cell{LoadCellConfig()};
  cell.step(0.01, kForce);
  cell.sample();
  EXPECT_EQ(cell.reading(), kForce);
}

TEST(LoadCell, BiasShiftsEachReading) {
  LoadCellConfig config;
  config.bias_n = -136.0;
  LoadCell cell(config);
  cell.step(0.01, kForce);
  cell.sample();
  EXPECT_DOUBLE_EQ(cell.reading().z(), 4864.0);
}

TEST(LoadCell, LagReaches63PercentAfterItsTimeConstant) {
  LoadCellConfig config;
  config.lag_s = 0.4;
  LoadCell cell(config);
  cell.step(0.001, Eigen::Vector3d::Zero());
  for (int k = 0; k < 400; ++k) cell.step(0.001, {0.0, 0.0, 1000.0});
  cell.sample();
  EXPECT_NEAR(cell.reading().z(), 1000.0 * (1.0 - std::exp(-1.0)), 1e-6);
}

TEST(LoadCell, StartsWithoutALagTransient) {
  LoadCellConfig config;
  config.lag_s = 5.0;
  LoadCell cell(config);
  cell.step(0.001, kForce);
  cell.sample();
  EXPECT_EQ(cell.reading(), kForce);
}

TEST(LoadCell, ResolutionRoundsToItsSteps) {
  LoadCellConfig config;
  config.resolution_n = 50.0;
  LoadCell cell(config);
  cell.step(0.01, {0.0, 0.0, 5024.0});
  cell.sample();
  EXPECT_DOUBLE_EQ(cell.reading().z(), 5000.0);
  cell.step(0.01, {0.0, 0.0, 5026.0});
  cell.sample();
  EXPECT_DOUBLE_EQ(cell.reading().z(), 5050.0);
}

TEST(LoadCell, TinyResolutionReadsTheTruth) {
  LoadCellConfig config;
  config.resolution_n = 1.0e-310;
  LoadCell cell(config);
  cell.step(0.01, kForce);
  cell.sample();
  EXPECT_EQ(cell.reading(), kForce);
}

TEST(LoadCell, NoiseHasItsStandardDeviationAndItsSeed) {
  LoadCellConfig config;
  config.noise_n = 88.0;
  LoadCell one(config), same(config);
  config.seed = 2;
  LoadCell other(config);
  const int samples = 20000;
  double sum = 0.0, squares = 0.0;
  bool differs = false;
  for (int k = 0; k < samples; ++k) {
    for (LoadCell* cell : {&one, &same, &other}) {
      cell->step(0.01, kForce);
      cell->sample();
    }
    ASSERT_EQ(one.reading(), same.reading());
    differs = differs || one.reading() != other.reading();
    const double error = one.reading().z() - kForce.z();
    sum += error;
    squares += error * error;
  }
  EXPECT_TRUE(differs);
  EXPECT_NEAR(sum / samples, 0.0, 4.0 * 88.0 / std::sqrt(samples));  // four standard errors
  EXPECT_NEAR(std::sqrt(squares / samples), 88.0, 4.0 * 88.0 / std::sqrt(2.0 * samples));
}

TEST(LoadCell, TareMakesThePresentReadingZeroFromTheNextSample) {
  LoadCellConfig config;
  config.bias_n = 30.0;
  LoadCell cell(config);
  cell.step(0.01, kForce);
  cell.sample();
  cell.tare();
  EXPECT_DOUBLE_EQ(cell.reading().z(), 5030.0);
  cell.sample();
  EXPECT_NEAR(cell.reading().norm(), 0.0, 1e-9);
  cell.step(0.01, kForce + Eigen::Vector3d(0.0, 0.0, 100.0));
  cell.sample();
  EXPECT_NEAR(cell.reading().z(), 100.0, 1e-9);
}

}  // namespace
}  // namespace brash_ice_rig
