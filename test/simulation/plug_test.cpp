#include "brash_ice_rig/simulation/plug.h"

#include <cmath>

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

constexpr double kSpacing = 0.3, kMass = 10.0, kHub = -1.0;

/// 9 x 9 columns of two layers, at and below the waterline.
std::vector<Eigen::Vector3d> sites() {
  std::vector<Eigen::Vector3d> points;
  for (int x = -4; x <= 4; ++x)
    for (int y = -4; y <= 4; ++y)
      for (int z = -1; z <= 0; ++z) points.emplace_back(kSpacing * x, kSpacing * y, kSpacing * z);
  return points;
}

TEST(Plug, IsEmptyInAnUndisturbedField) {
  const PlugSummary plug = computePlug(sites(), sites(), kSpacing, kMass, kHub);
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
  const PlugSummary plug = computePlug(sites(), moved, kSpacing, kMass, kHub);
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
  EXPECT_EQ(computePlug(original, moved, kSpacing, kMass, kHub).hole_refill_ratio, 0.0);
  // One neighbour slides into the lower site.
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if ((original[i] - Eigen::Vector3d(kSpacing, 0.0, -kSpacing)).norm() < 1e-9) moved[i].x() -= 0.25;
  }
  EXPECT_DOUBLE_EQ(computePlug(original, moved, kSpacing, kMass, kHub).hole_refill_ratio, 0.5);
}

TEST(Plug, IceThatFloatsUpBelowTheHubIsNotRaisedButFillsTheHole) {
  const auto original = sites();
  auto moved = original;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if (original[i].head<2>().norm() < 0.1) moved[i].z() += 2.0;
    // A neighbour of the lower layer floats up into the upper site of the hole.
    if ((original[i] - Eigen::Vector3d(kSpacing, 0.0, -kSpacing)).norm() < 1e-9) {
      moved[i] += Eigen::Vector3d(-kSpacing, 0.0, 1.1 * kSpacing);
    }
  }
  const PlugSummary plug = computePlug(original, moved, kSpacing, kMass, 1.5);
  EXPECT_EQ(plug.raised_particles, 2u);
  EXPECT_EQ(plug.hole_refill_ratio, 0.5);
  EXPECT_EQ(plug.hole_cover_ratio, 1.0);
  EXPECT_EQ(computePlug(original, moved, kSpacing, kMass, kHub).raised_particles, 3u);
}

TEST(Plug, HoleIsCoveredWhereAnyLayerOfNeighboursLiesInItsColumn) {
  const auto original = sites();
  auto moved = original;
  // The columns at x = 0, y = 0 and 0.3 m go up whole, the one at y = -0.3 m only with its top layer: no hole there.
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const Eigen::Vector3d& site = original[i];
    if (std::abs(site.x()) > 0.1 || std::abs(site.y()) > 0.4) continue;
    if (site.y() > -0.1 || site.z() == 0.0) moved[i].z() += 1.0;
  }
  EXPECT_EQ(computePlug(original, moved, kSpacing, kMass, kHub).hole_cover_ratio, 0.0);
  // A neighbour slides over one of the two, in a depth where no site was.
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if ((original[i] - Eigen::Vector3d(kSpacing, kSpacing, 0.0)).norm() < 1e-9) {
      moved[i] += Eigen::Vector3d(-0.25, 0.0, 0.2);
    }
  }
  const PlugSummary plug = computePlug(original, moved, kSpacing, kMass, kHub);
  EXPECT_EQ(plug.hole_cover_ratio, 0.5);
  EXPECT_EQ(plug.hole_refill_ratio, 0.0);
}

TEST(Plug, BulgeIsTheRiseOfTheTopLayerOnly) {
  const auto original = sites();
  auto moved = original;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const bool top = original[i].z() == 0.0;
    const double distance = original[i].head<2>().norm();
    if (!top) moved[i].z() += 0.25;                  // the layer below rises farther, and everywhere
    if (top && distance < 0.7) moved[i].z() += 0.2;  // less than a spacing: nothing is raised yet
    if (top && distance > 1.2) moved[i].z() -= 0.1;
  }
  const PlugSummary plug = computePlug(original, moved, kSpacing, kMass, kHub);
  EXPECT_EQ(plug.raised_particles, 0u);
  EXPECT_DOUBLE_EQ(plug.bulge_height_m, 0.2);
  EXPECT_DOUBLE_EQ(plug.bulge_radius_m, std::hypot(0.6, 0.3));  // the farthest of the lattice within 0.7 m
}

TEST(Plug, BulgeReachesToWhereTheSurfaceHasRisenByATenthOfTheSpacing) {
  const auto original = sites();
  auto moved = original;
  // A cone: at its foot the rise is nothing.
  for (std::size_t i = 0; i < moved.size(); ++i) {
    moved[i].z() += std::max(0.0, 0.1 - 0.1 * original[i].head<2>().norm());
  }
  const PlugSummary plug = computePlug(original, moved, kSpacing, kMass, kHub);
  EXPECT_DOUBLE_EQ(plug.bulge_height_m, 0.1);
  // 0.03 m is reached at 0.7 m; the columns beside it stand at 0.671 and 0.849 m.
  EXPECT_DOUBLE_EQ(plug.bulge_radius_m, std::hypot(0.6, 0.3));
}

TEST(Plug, SunkenSurfaceHasNoBulge) {
  auto moved = sites();
  for (auto& p : moved) p.z() -= 0.1;
  const PlugSummary plug = computePlug(sites(), moved, kSpacing, kMass, kHub);
  EXPECT_EQ(plug.bulge_height_m, 0.0);
  EXPECT_EQ(plug.bulge_radius_m, 0.0);
}

TEST(Plug, TopLayerIsWholeUnderTheLargestJitter) {
  // The highest site 0.3 spacings over its place in the lattice, the others of the top layer 0.3 below theirs, those of
  // the layer below 0.3 over theirs.
  auto original = sites();
  for (auto& p : original) {
    const bool highest = p == Eigen::Vector3d::Zero();
    p.z() += (p.z() == 0.0 && !highest ? -0.3 : 0.3) * kSpacing;
  }
  auto moved = original;
  for (auto& p : moved) p.z() += p.z() > -0.5 * kSpacing ? 0.05 : 0.09;
  const PlugSummary plug = computePlug(original, moved, kSpacing, kMass, kHub);
  EXPECT_NEAR(plug.bulge_height_m, 0.05, 1e-12) << "0.09: the layer below was taken for the surface";
  EXPECT_NEAR(plug.bulge_radius_m, std::hypot(1.2, 1.2), 1e-12) << "part of the surface was left out";
}

/// Shoelace formula; > 0 if the corners run counter-clockwise.
double area(const std::vector<Eigen::Vector3d>& polygon) {
  double sum = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector3d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    sum += 0.5 * (a.x() * b.y() - b.x() * a.y());
  }
  return sum;
}

/// Area of a regular polygon with twelve corners, and of the hull of such polygons around the corners of a square: the
/// square, four strips along its sides, and the polygon cut into its four corners.
constexpr double kRadius = 0.5 * kSpacing;
const double kTwelveCorners = 3.0 * kRadius * kRadius;
double grownSquare(double side_m) {
  return side_m * side_m + 4.0 * side_m * kRadius + kTwelveCorners;
}

TEST(PlugOutline, IsEmptyWithoutRaisedIce) {
  const PlugOutline outline = computePlugOutline(sites(), sites(), kSpacing, kHub);
  EXPECT_TRUE(outline.waterline.empty());
  EXPECT_TRUE(outline.top.empty());
  EXPECT_TRUE(outline.hole.empty());
}

TEST(PlugOutline, OfASingleParticleIsItsSection) {
  const std::vector<Eigen::Vector3d> site = {{1.0, 2.0, -0.9}}, position = {{1.5, 2.0, 0.1}};
  const PlugOutline outline = computePlugOutline(site, position, kSpacing, kHub);
  EXPECT_EQ(outline.top.size(), 12u);
  EXPECT_NEAR(area(outline.top), kTwelveCorners, 1e-12);
  EXPECT_NEAR(area(outline.waterline), kTwelveCorners, 1e-12) << "it is at the waterline, too";
  for (const auto& corner : outline.top) {
    EXPECT_NEAR((corner - Eigen::Vector3d(1.5, 2.0, 0.1)).norm(), kRadius, 1e-12) << "at the particle's height";
  }
  for (const auto& corner : outline.hole) {
    EXPECT_NEAR((corner - Eigen::Vector3d(1.0, 2.0, 0.0)).norm(), kRadius, 1e-12) << "on the water";
  }
  for (const auto& corner : outline.waterline) EXPECT_EQ(corner.z(), 0.0);
}

TEST(PlugOutline, WaterlineTopAndHoleAreTheHullsOfTheirOwnParticles) {
  // Of 5 x 5 columns the lower layer comes to the waterline; the upper one, of 3 x 3 columns only, rises above it.
  const auto original = sites();
  auto moved = original;
  for (auto& p : moved) {
    const double reach = p.head<2>().lpNorm<Eigen::Infinity>();
    if (p.z() < -0.1 && reach < 2.1 * kSpacing) p.z() = 0.01;
    if (p.z() == 0.0 && reach < 1.1 * kSpacing) p += Eigen::Vector3d(0.1, 0.0, 0.7);
  }
  const PlugOutline outline = computePlugOutline(original, moved, kSpacing, kHub);
  EXPECT_NEAR(area(outline.waterline), grownSquare(4.0 * kSpacing), 1e-9);
  EXPECT_NEAR(area(outline.top), grownSquare(2.0 * kSpacing), 1e-9);
  EXPECT_NEAR(area(outline.hole), grownSquare(4.0 * kSpacing), 1e-9);
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const auto& corner : outline.top) centre += corner / static_cast<double>(outline.top.size());
  EXPECT_NEAR(centre.x(), 0.1, 1e-9) << "the outline follows the particles, not their sites";
  EXPECT_NEAR(centre.z(), 0.7, 1e-9);
}

TEST(PlugOutline, CornersAreASpacingApartAtMostAndLieOnTheIceThatIsLeft) {
  // Around a plug of 7 x 7 columns the ice has risen by 0.2 m on one side, too little to count as raised.
  const auto original = sites();
  auto moved = original;
  for (auto& p : moved) {
    const bool plug = p.head<2>().lpNorm<Eigen::Infinity>() < 3.1 * kSpacing;
    p.z() += plug ? 1.0 : p.x() > 0.0 ? 0.2 : 0.0;
  }
  const auto hole = computePlugOutline(original, moved, kSpacing, kHub).hole;
  ASSERT_FALSE(hole.empty());
  EXPECT_NEAR(area(hole), grownSquare(6.0 * kSpacing), 1e-9);
  for (std::size_t i = 0; i < hole.size(); ++i) {
    EXPECT_LE((hole[(i + 1) % hole.size()] - hole[i]).norm(), kSpacing + 1e-12);
    EXPECT_NEAR(hole[i].z(), 0.2 + kRadius, 1e-12);
  }
}

TEST(PlugOutline, HoleIsOnlyWhereTheBottomLayerHasGone) {
  const auto original = sites();
  auto moved = original;
  for (auto& p : moved) {
    if (p.z() == 0.0 && p.head<2>().norm() < 1.0) p.z() += 1.0;  // the upper layer alone
  }
  const PlugOutline outline = computePlugOutline(original, moved, kSpacing, kHub);
  EXPECT_FALSE(outline.top.empty());
  EXPECT_TRUE(outline.hole.empty());
  EXPECT_TRUE(outline.waterline.empty());
}

}  // namespace
}  // namespace brash_ice_rig
