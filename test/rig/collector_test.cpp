#include "brash_ice_rig/rig/collector.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

namespace brash_ice_rig {
namespace {

constexpr double kStep = 0.0025;

StatusFlags run(Collector& collector, double target, double moment, double duration_s) {
  StatusFlags flags;
  for (int k = 0; k < static_cast<int>(duration_s / kStep + 0.5); ++k) collector.step(kStep, target, moment, flags);
  return flags;
}

TEST(Collector, UnfoldedTipsLieOnTheCircumscribedCircleAtRimHeight) {
  const Collector collector(CollectorConfig(), true);
  for (int arm = 0; arm < kArmCount; ++arm) {
    EXPECT_NEAR(collector.armTip(arm).head<2>().norm(), 1.3, 1e-12);
    EXPECT_NEAR(collector.armTip(arm).z(), 0.3, 1e-12);
  }
  EXPECT_NEAR((collector.armTip(0) - collector.armTip(1)).norm(), 2.0 * 1.3 * std::sin(M_PI / 8.0), 1e-12);
}

TEST(Collector, UnfoldsAtItsRateAndLocks) {
  Collector collector(CollectorConfig(), false);
  EXPECT_NEAR(collector.armAngle() * 180.0 / M_PI, 80.0, 1e-9);
  run(collector, 1.0, 0.0, 5.0);
  EXPECT_NEAR(collector.foldRatio(), 0.5, 1e-9);
  EXPECT_FALSE(collector.locked());
  const StatusFlags flags = run(collector, 1.0, 0.0, 5.1);
  EXPECT_DOUBLE_EQ(collector.foldRatio(), 1.0);
  EXPECT_TRUE(collector.locked());
  EXPECT_FALSE(flags.any());
}

TEST(Collector, LockedArmsHoldAnyLoad) {
  Collector collector(CollectorConfig(), true);
  run(collector, 1.0, 1.0e6, 10.0);
  EXPECT_DOUBLE_EQ(collector.foldRatio(), 1.0);
}

TEST(Collector, JamStopsTheArmsAtItsRatioAndSaysSo) {
  CollectorConfig config;
  config.fault = FoldFault::kJam;
  config.jam_ratio = 0.3;
  Collector collector(config, false);
  const StatusFlags flags = run(collector, 1.0, 0.0, 20.0);
  EXPECT_NEAR(collector.foldRatio(), 0.3, 1e-12);
  EXPECT_TRUE(collector.jammed());
  EXPECT_TRUE(flags.has(StatusFlag::kFoldJammed));
}

TEST(Collector, UnlockedArmsDroopUnderLoadOnly) {
  CollectorConfig config;
  config.fault = FoldFault::kNoLock;
  Collector collector(config, false);
  const StatusFlags flags = run(collector, 1.0, 0.0, 20.0);
  EXPECT_NEAR(collector.foldRatio(), 1.0, 1e-12);
  EXPECT_FALSE(collector.locked());
  EXPECT_TRUE(flags.has(StatusFlag::kFoldUnlocked));
  run(collector, 1.0, 0.9 * config.unlocked_holding_moment_nm, 5.0);
  EXPECT_NEAR(collector.foldRatio(), 1.0, 1e-12);
  run(collector, 1.0, 10.0 * config.unlocked_holding_moment_nm, 60.0);
  EXPECT_NEAR(collector.armAngle() * 180.0 / M_PI, -60.0, 1e-6);
}

/// Distance from a point to a triangle by scanning it finely.
double scannedDistance(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                       const Eigen::Vector3d& c) {
  double nearest = 1e9;
  const int n = 400;
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; i + j <= n; ++j) {
      nearest = std::min(nearest, (p - (a + (b - a) * i / n + (c - a) * j / n)).norm());
    }
  }
  return nearest;
}

TEST(CollectorNet, NearestPointIsThatOfTheOctagonalCone) {
  std::mt19937 generator(4);
  std::uniform_real_distribution<double> along(-1.6, 1.6);
  const Collector collector(CollectorConfig(), true);
  for (int trial = 0; trial < 60; ++trial) {
    const Eigen::Vector3d p(along(generator), along(generator), 0.4 * along(generator));
    double expected = 1e9;
    for (int arm = 0; arm < kArmCount; ++arm) {
      expected = std::min(expected, scannedDistance(p, Eigen::Vector3d::Zero(), collector.armTip(arm),
                                                    collector.armTip((arm + 1) % kArmCount)));
    }
    // The facet is chosen by azimuth; near an arm the neighbour may be nearer by a little.
    const double found = (p - collector.nearestNetPoint(p).offset_m).norm();
    EXPECT_GE(found, expected - 2e-5);  // what scanning on a grid of 1/400 can miss
    EXPECT_LE(found, expected + 0.02) << p.transpose();
  }
}

TEST(CollectorNet, NormalPointsIntoTheUmbrella) {
  for (const bool unfolded : {false, true}) {
    const Collector collector(CollectorConfig(), unfolded);
    for (int k = 0; k < 24; ++k) {
      const double azimuth = 0.3 + k * M_PI / 12.0;
      const NetPoint point = collector.nearestNetPoint({0.8 * std::cos(azimuth), 0.8 * std::sin(azimuth), 0.3});
      EXPECT_NEAR(point.normal.norm(), 1.0, 1e-12);
      EXPECT_GT(point.normal.z(), 0.0);
      EXPECT_LT(point.normal.head<2>().dot(Eigen::Vector2d(std::cos(azimuth), std::sin(azimuth))), 0.0);
    }
  }
}

TEST(CollectorNet, PointVelocityIsTheMotionOfThatSpotWhileUnfolding) {
  Collector collector(CollectorConfig(), false);
  run(collector, 1.0, 0.0, 4.0);
  // A spot on an arm: seen from just beside it, at half its length.
  const auto armSpot = [&] { return Eigen::Vector3d(0.5 * (collector.armTip(0) + collector.armTip(1)) * 0.5); };
  const Eigen::Vector3d before = armSpot();
  StatusFlags flags;
  collector.step(kStep, 1.0, 0.0, flags);
  const Eigen::Vector3d after = armSpot();
  const NetPoint point = collector.nearestNetPoint(after);
  EXPECT_LT((point.velocity_mps - (after - before) / kStep).norm(), 1e-3 * point.velocity_mps.norm());
}

TEST(Collector, HangingInAirItWeighsMassTimesGravity) {
  CollectorConfig config;
  config.mass_kg = 150.0;
  config.pole_mass_kg = 40.0;
  const Collector collector(config, true);
  EXPECT_NEAR(collector.weight(), 190.0 * 9.81, 1e-9);
  EXPECT_EQ(collector.buoyancy(0.5, 1000.0), 0.0);
}

TEST(Collector, BuoyancyIsArchimedes) {
  const CollectorConfig config;  // 0.02 m³ of steel and net, pole of 0.05 m radius
  const Collector collector(config, true);
  const double expected = (0.02 + M_PI * 0.05 * 0.05 * 2.0) * 1000.0 * 9.81;
  EXPECT_NEAR(collector.buoyancy(-2.0, 1000.0), expected, 1e-9);
}

TEST(Collector, DroopingArmsFloatAsFarAsTheyReachIntoTheWater) {
  CollectorConfig config;
  config.fault = FoldFault::kNoLock;
  Collector collector(config, true);
  StatusFlags flags;
  for (int k = 0; k < 10000; ++k) collector.step(0.01, 1.0, 1.0e6, flags);
  const double depth = -collector.armTip(0).z();
  ASSERT_GT(depth, 1.0);
  const double full = 0.02 * 1000.0 * 9.81;
  EXPECT_NEAR(collector.buoyancy(0.5 * depth, 1000.0), 0.5 * full, 1e-9);  // hub in the air, tips in the water
  EXPECT_EQ(collector.buoyancy(depth, 1000.0), 0.0);
  EXPECT_NEAR(collector.buoyancy(0.0, 1000.0), full, 1e-9);
}

TEST(Collector, NoPlaceOnTheNetIsNearerThanTheNearest) {
  // Folded, half open and unfolded: beside a facet the nearest place lies on an arm.
  for (const double target : {0.0, 0.5, 1.0}) {
    Collector collector(CollectorConfig(), false);
    run(collector, target, 0.0, 10.0 * target + 0.1);
    std::mt19937_64 generator(7);
    std::uniform_real_distribution<double> any(-1.6, 1.6), share(0.0, 1.0);
    for (int point = 0; point < 300; ++point) {
      const Eigen::Vector3d offset(any(generator), any(generator), any(generator));
      const NetPoint nearest = collector.nearestNetPoint(offset);
      // The facet is a triangle of hub and two arm tips; each of its places is a blend of the tips.
      const double azimuth = std::atan2(offset.y(), offset.x()) * kArmCount / (2.0 * M_PI);
      const int first = (static_cast<int>(std::floor(azimuth)) + kArmCount) % kArmCount;
      const Eigen::Vector3d a = collector.armTip(first), b = collector.armTip((first + 1) % kArmCount);
      double best = offset.norm();
      for (int k = 0; k < 4000; ++k) {
        double p = share(generator), q = share(generator);
        if (p + q > 1.0) p = 1.0 - p, q = 1.0 - q;
        best = std::min(best, (offset - p * a - q * b).norm());
      }
      for (int k = 0; k <= 2000; ++k) {
        const double along = k / 2000.0;
        best = std::min(
            {best, (offset - along * a).norm(), (offset - along * b).norm(), (offset - a - along * (b - a)).norm()});
      }
      EXPECT_LE((offset - nearest.offset_m).norm(), best + 1e-9) << offset.transpose();
      EXPECT_NEAR((offset - nearest.offset_m).norm(), best, 0.02) << offset.transpose();
    }
  }
}

}  // namespace
}  // namespace brash_ice_rig
