#include "brash_ice_rig/rig/crane.h"

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

constexpr double kStep = 0.0025;

CraneConfig config() {
  CraneConfig c;
  c.max_speed_mps = 0.5;
  c.max_acceleration_mps2 = 0.5;
  c.min_height_m = 0.0;
  c.max_height_m = 2.0;
  c.max_reach_m = 1.0;
  return c;
}

StatusFlags run(Crane& crane, const Eigen::Vector3d& wanted, double duration_s) {
  StatusFlags flags;
  for (int k = 0; k < static_cast<int>(duration_s / kStep + 0.5); ++k) crane.step(kStep, wanted, flags);
  return flags;
}

TEST(Crane, RampsAtTheAccelerationLimit) {
  Crane crane(config(), {0.0, 0.0, 1.0});
  run(crane, {0.0, 0.0, 0.4}, 0.4);
  EXPECT_NEAR(crane.velocity().z(), 0.2, 1e-9);  // 0.5 m/s² x 0.4 s
  EXPECT_NEAR(crane.acceleration().z(), 0.5, 1e-9);
  run(crane, {0.0, 0.0, 0.4}, 0.8);
  EXPECT_NEAR(crane.velocity().z(), 0.4, 1e-9);
  EXPECT_NEAR(crane.acceleration().z(), 0.0, 1e-9);
}

TEST(Crane, CutsTheSpeedAtTheLimitAndSaysSo) {
  Crane crane(config(), {0.0, 0.0, 0.2});
  const StatusFlags flags = run(crane, {0.0, 0.0, 3.0}, 1.5);
  EXPECT_NEAR(crane.velocity().z(), 0.5, 1e-9);
  EXPECT_TRUE(flags.has(StatusFlag::kSpeedLimited));
  EXPECT_FALSE(flags.has(StatusFlag::kTravelLimit));
}

TEST(Crane, StopsAtEachEndOfTravelWithoutOvershootAndSaysSo) {
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    for (const double direction : {-1.0, 1.0}) {
      Crane crane(config(), {0.0, 0.0, 1.0});
      Eigen::Vector3d wanted = Eigen::Vector3d::Zero();
      wanted[axis] = 0.5 * direction;
      StatusFlags flags;
      for (int k = 0; k < 4000; ++k) {
        crane.step(kStep, wanted, flags);
        EXPECT_LE(std::abs(crane.acceleration()[axis]), 0.5 + 1e-9);
      }
      const double centre = axis == 2 ? 1.0 : 0.0;
      EXPECT_NEAR(crane.position()[axis], centre + direction, 1e-3);
      EXPECT_NEAR(crane.velocity()[axis], 0.0, 1e-3);
      EXPECT_TRUE(flags.has(StatusFlag::kTravelLimit));
    }
  }
}

TEST(Crane, BrakesSoThatVelocityAndPositionAgreeUpToTheEndOfTravel) {
  // Were the position held at the limit while the velocity is not yet zero, contact and inertia would see a motion
  // that is not there.
  for (int start = 0; start < 500; ++start) {
    Crane crane(config(), {0.0, 0.0, 1.0 + 1.0e-3 * start});
    for (int k = 0; k < 2500; ++k) {
      const double before = crane.position().z();
      StatusFlags flags;
      crane.step(kStep, {0.0, 0.0, 0.5}, flags);
      ASSERT_NEAR(crane.position().z() - before, kStep * crane.velocity().z(), 1e-12) << start << " " << k;
    }
  }
}

TEST(Crane, AxesMoveOnTheirOwn) {
  Crane crane(config(), {0.0, 0.0, 1.0});
  run(crane, {0.1, -0.05, 0.2}, 1.0);
  EXPECT_NEAR(crane.velocity().x(), 0.1, 1e-9);
  EXPECT_NEAR(crane.velocity().y(), -0.05, 1e-9);
  EXPECT_NEAR(crane.velocity().z(), 0.2, 1e-9);
}

TEST(Crane, PositionIsTheIntegralOfTheVelocity) {
  Crane crane(config(), {0.0, 0.0, 0.5});
  run(crane, {0.0, 0.0, 0.052}, 10.0);
  // Ramp of 0.052 / 0.5 s costs half of it at full speed.
  EXPECT_NEAR(crane.position().z(), 0.5 + 0.052 * (10.0 - 0.5 * 0.104), 1e-4);
}

}  // namespace
}  // namespace brash_ice_rig
