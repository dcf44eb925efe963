// Uplift capacity of a strip anchor, the nearest textbook problem to the pull-up test, against limit analysis.

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/material/cap_model.h"
#include "guided_body.h"
#include "plane_strain_strength.h"

namespace brash_ice_rig {
namespace {

constexpr double kDensity = 360.0;  // kg/m³
constexpr double kWidth = 0.8;      // of the plate, m
constexpr double kDepth = 1.2;      // of its underside below the surface, m
constexpr double kCohesion = 1000.0;
constexpr double kUnitWeight = kDensity * kGravityMps2;  // N/m³

/// Largest force on the plate, N per metre, weight of the ice that is the plate included.
double measureCapacity(int plate_columns, double friction_angle_deg, double speed_mps) {
  const double dx = kWidth / plate_columns;
  const int rows = static_cast<int>(std::lround(kDepth / dx));
  const int margin = static_cast<int>(std::lround((kDepth + 0.4) / dx));
  constexpr int kSlice = 3, kBase = 3, kRoom = 3;
  // The plate is the lowest row of ice over a cavity, so that nothing sucks at it from below; beside the cavity the ice
  // goes down to a rigid base.
  std::vector<Eigen::Vector3d> points;
  std::vector<bool> fixed;
  std::vector<std::size_t> group;
  const int columns = plate_columns + 2 * margin, height = rows + kRoom + kBase;
  constexpr std::size_t kPlate = 0;
  for (int x = -kBase; x < columns + kBase; ++x)
    for (int y = 0; y < kSlice; ++y)
      for (int z = -kRoom - kBase; z < rows; ++z) {
        const bool over_plate = x >= margin && x < margin + plate_columns;
        if (over_plate && z < 0) continue;
        points.emplace_back(dx * (x + 0.5 - 0.5 * columns), dx * y, dx * (z + 0.5 - rows));
        fixed.push_back(z < -kRoom || x < 0 || x >= columns);
        const int row = (x + kBase) * height + z + kRoom + kBase;
        group.push_back(over_plate && z == 0 ? kPlate : 1 + static_cast<std::size_t>(row));
      }
  const CapModel material(capOutOfTheWay(matchPlaneStrain(kCohesion, friction_angle_deg), 1.0e6));
  GuidedBody body(sliceSettings(dx, kDensity), material, points, fixed, group, {1.0f, 0.0f, 1.0f});
  const auto weight = static_cast<float>(body.sph.particleMass() * kGravityMps2);
  const Eigen::Vector4f force(0.0f, 0.0f, -weight, 0.0f);
  const auto external = [&force](std::size_t) { return force; };
  const double time_step =
      0.5 * 1.2 * dx / std::sqrt((material.bulkModulus() + 4.0 / 3.0 * material.shearModulus()) / kDensity);
  const auto load = [&] { return -body.forceOn(kPlate).z() / (kSlice * dx); };

  body.drive(kPlate, Eigen::Vector3d::Zero());
  for (double time = 0.0; time < 1.5; time += time_step) body.step(time_step, 5.0, external);
  body.drive(kPlate, {0.0, 0.0, speed_mps});
  // A sliding mean over 0.05 s takes off the ringing of the start, at 10 Hz and more.
  double mean = load(), largest = mean;
  for (double way = 0.0; way < 0.05; way += time_step * speed_mps) {
    body.step(time_step, 2.0, external);
    mean += (load() - mean) * time_step / 0.05;
    largest = std::max(largest, mean);
  }
  return largest + kUnitWeight * kWidth * dx;
}

/// Rigid block between planes that lean outwards by phi (Murray and Geddes 1987), an upper bound of limit analysis:
///   Q = gamma H (B + H tan(phi)) + 2 c H.
/// Meyerhof and Adams (1968) give the same for a shallow strip, with K_u tan(phi) for tan(phi), K_u from 0.9 to 0.95.
/// @param uplift_coefficient  K_u; 1 for the upper bound
double shallowAnchorCapacity(double friction_angle_deg, double uplift_coefficient) {
  const double tangent = std::tan(friction_angle_deg * 3.14159265358979323846 / 180.0);
  return kUnitWeight * kDepth * (kWidth + uplift_coefficient * kDepth * tangent) + 2.0 * kCohesion * kDepth;
}

TEST(Anchor, ShallowStripPullsOutTheBlockOfLimitAnalysis) {
  // The exact capacity is at most the bound and, at 1.5 widths of depth, at most some 10 % below it: so much parts the
  // upper and lower bounds without friction (Merifield et al. 2001). Particles smear the slip, which holds the more the
  // coarser they are: 3 % over the bound are allowed.
  constexpr double kSpeed = 0.01;
  std::vector<int> resolutions = {4, 8};
  if (fineRequested()) resolutions.push_back(16);
  for (const double angle : {1.0, 20.0, 30.0}) {
    const double bound = shallowAnchorCapacity(angle, 1.0);
    const std::string name = "_at_" + std::to_string(static_cast<int>(angle)) + "_deg";
    report("upper_bound_npm" + name, bound);
    report("meyerhof_adams_over_bound" + name, shallowAnchorCapacity(angle, 0.9) / bound);
    for (const int columns : resolutions) {
      const double found = measureCapacity(columns, angle, kSpeed);
      const std::string at = name + "_with_" + std::to_string(columns) + "_columns";
      report("capacity_npm" + at, found);
      report("capacity_over_bound" + at, found / bound);
      EXPECT_GT(found / bound, 0.90);
      EXPECT_LT(found / bound, 1.03);
    }
  }
}

TEST(Anchor, CapacityDoesNotDependOnTheSpeed) {
  // Cone and flow know no rate; inertia and artificial viscosity do. Viscous stress at 10 mm/s is of the order of
  // rho alpha c 1.2 V / 10 = 2.5 Pa beside a cohesion of 1000 Pa (theory.md, viscosity), damping of 2/s on a block that
  // moves at 10 mm/s is 0.2 % of its weight, and what is left of the ringing passes the mean: 1 % for all of them.
  const double slow = measureCapacity(4, 20.0, 0.005), fast = measureCapacity(4, 20.0, 0.01);
  report("capacity_at_half_speed_over_full", slow / fast);
  EXPECT_NEAR(slow / fast, 1.0, 0.01);
}

}  // namespace
}  // namespace brash_ice_rig
