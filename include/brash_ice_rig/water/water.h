#pragma once

#include <Eigen/Core>

#include "brash_ice_rig/config/scenario.h"

namespace brash_ice_rig {

/// Weight, buoyancy and drag of one particle (eqs. 1 to 3; the printed signs are corrected, see doc/theory.md).
/// The still waterline is z = 0. A particle is a cube of side `spacing` of which 1 - V_f is ice.
class ParticleInWater {
 public:
  ParticleInWater(const WaterConfig& water, const IceConfig& ice, double spacing_m)
      : spacing_(static_cast<float>(spacing_m)) {
    const double solid = 1.0 - ice.void_fraction;
    const double volume = spacing_m * spacing_m * spacing_m;
    weight_ = static_cast<float>(ice.parent_density_kgpm3 * solid * kGravityMps2 * volume);
    full_buoyancy_ = static_cast<float>(water.density_kgpm3 * solid * kGravityMps2 * volume);
    drag_ = static_cast<float>(0.5 * water.drag_coefficient * water.density_kgpm3 * solid * spacing_m * spacing_m);
  }

  /// Share of the particle under water, 0..1, from the height of its centre, m.
  float submerged(float height_m) const {
    const float share = 0.5f - height_m / spacing_;
    return share < 0.0f ? 0.0f : (share > 1.0f ? 1.0f : share);
  }

  /// N, > 0.
  float weight() const { return weight_; }
  /// N, upward, >= 0.
  float buoyancy(float submerged) const { return full_buoyancy_ * submerged; }
  /// N, against the velocity; quadratic.
  Eigen::Vector4f drag(const Eigen::Vector4f& velocity_mps, float submerged) const {
    return -drag_ * submerged * velocity_mps.head<3>().norm() * velocity_mps;
  }

  /// Potential energy of weight and buoyancy, J: 0 at the waterline, and where a particle is just clear of the water.
  /// Their negative derivatives by the height are -weight() and buoyancy(submerged(height)).
  double weightPotential(double height_m) const { return static_cast<double>(weight_) * height_m; }
  double buoyancyPotential(double height_m) const {
    const double spacing = static_cast<double>(spacing_);
    const double depth = 0.5 * spacing - height_m;  // of the lower face
    const double rise = depth < 0.0 ? 0.0 : (depth > spacing ? depth - 0.5 * spacing : 0.5 * depth * depth / spacing);
    return static_cast<double>(full_buoyancy_) * rise;
  }

  /// All three forces, N, w = 0.
  Eigen::Vector4f force(float height_m, const Eigen::Vector4f& velocity_mps) const {
    const float share = submerged(height_m);
    // In one sum: a component that is written into a vector in memory delays whoever reads all of it.
    return drag(velocity_mps, share) + Eigen::Vector4f(0.0f, 0.0f, buoyancy(share) - weight_, 0.0f);
  }

 private:
  float spacing_, weight_, full_buoyancy_, drag_;
};

}  // namespace brash_ice_rig
