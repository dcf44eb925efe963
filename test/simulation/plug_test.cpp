#include "brash_ice_rig/simulation/plug.h"

#include <cmath>

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

constexpr double kSpacing = 0.3, kMass = 10.0;

/// 9 x 9 columns of two layers, at and below the waterline.
std::vector<Eigen::Vector3d> sites() {
  std::vector<Eigen::Vector3d> points;
  for (int x = -4; x <= 4; ++x)
    for (int y = -4; y <= 4; ++y)
      for (int z = -1; z <= 0; ++z) points.emplace_back(kSpacing * x, kSpacing * y, kSpacing * z);
  return points;
}

TEST(Plug, IsEmptyInAnUndisturbedField) {
  const PlugSummary plug = computePlug(sites(), sites(), kSpacing, kMass);
  EXPECT_EQ(plug.raised_particles, 0u);
  EXPECT_EQ(plug.lifted_mass_kg, 0.0);
  EXPECT_EQ(plug.hole_refill_ratio, 0.0);
}

TEST(Plug, CountsMassAndRadiiOfARaisedColumn) {
  auto moved = sites();
  std::size_t columns = 0;
  for (auto& p : moved) {
    if (p.head<2>().norm() > 0.5) continue;
    if (p.z() == 0.0) ++columns;
    p.z() += 0.6;
  }
  const PlugSummary plug = computePlug(sites(), moved, kSpacing, kMass);
  EXPECT_EQ(plug.raised_particles, 2 * columns);
  EXPECT_NEAR(plug.lifted_mass_kg, 20.0 * static_cast<double>(columns), 1e-9);
  EXPECT_NEAR(plug.radius_at_top_m, kSpacing * std::sqrt(static_cast<double>(columns) / M_PI), 1e-9);
  EXPECT_EQ(plug.radius_at_waterline_m, 0.0);  // 0.3 and 0.6 m over it
  EXPECT_EQ(plug.hole_refill_ratio, 0.0);
}

TEST(Plug, HoleIsRefilledByNeighboursNotByThePlugItself) {
  const auto original = sites();
  auto moved = original;
  std::vector<std::size_t> lifted;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if (original[i].head<2>().norm() < 0.1) {
      moved[i].z() += 1.0;
      lifted.push_back(i);
    }
  }
  ASSERT_EQ(lifted.size(), 2u);
  EXPECT_EQ(computePlug(original, moved, kSpacing, kMass).hole_refill_ratio, 0.0);
  // One neighbour slides into the lower site.
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if ((original[i] - Eigen::Vector3d(kSpacing, 0.0, -kSpacing)).norm() < 1e-9) moved[i].x() -= 0.25;
  }
  EXPECT_DOUBLE_EQ(computePlug(original, moved, kSpacing, kMass).hole_refill_ratio, 0.5);
}

}  // namespace
}  // namespace brash_ice_rig
