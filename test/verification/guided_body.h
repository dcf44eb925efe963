#pragma once

#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "brash_ice_rig/sph/sph_body.h"

namespace brash_ice_rig {

/// Prints a figure for doc/verification.md and leaves it in the test's XML record.
inline void report(const std::string& name, double value) {
  std::cout << "[   FIGURE ] " << name << " = " << value << std::endl;
  ::testing::Test::RecordProperty(name, std::to_string(value));
}

/// Whether to run the finest resolutions as well: environment variable BRASH_ICE_VERIFY_FINE. They take minutes.
inline bool fineRequested() {
  return std::getenv("BRASH_ICE_VERIFY_FINE") != nullptr;  // NOLINT(concurrency-mt-unsafe)
}

/// The solver's shipped settings (config/scenarios/pull_up.yaml) for another spacing and density.
inline SphSettings shippedSettings(double spacing_m, double density_kgpm3) {
  SphSettings s;
  s.particle_volume_m3 = spacing_m * spacing_m * spacing_m;
  s.density_kgpm3 = density_kgpm3;
  s.smoothing_length_m = 1.2 * spacing_m;
  s.skin_m = 0.15 * spacing_m;
  s.refresh_distance_m = 0.01 * spacing_m;
  return s;
}

/// The same for a slice a few particles thick that stands for a body without an end along y. At the shipped limit of
/// the determinant a particle on two faces does without the gradient correction (patch_test.cpp), and in a thin slice
/// that would be the whole surface.
inline SphSettings sliceSettings(double spacing_m, double density_kgpm3) {
  SphSettings s = shippedSettings(spacing_m, density_kgpm3);
  s.determinant_limit = 0.01;
  return s;
}

/// A body with guides, which make plane strain or uniaxial strain out of a body in three dimensions: the particles of a
/// group move as one, with their mean acceleration, and not at all along an axis that is held. The SPH force is the
/// virtual-work adjoint of the velocity gradient, so this is the exact restriction of the discrete body to such
/// motions: the guides do no work.
class GuidedBody {
 public:
  /// @param group  of each particle, 0..n-1; groups are as large as they like
  /// @param free   1 for each axis along which particles may move, 0 where they are held
  GuidedBody(const SphSettings& settings, const Material& material, const std::vector<Eigen::Vector3d>& position_m,
             const std::vector<bool>& fixed, const std::vector<std::size_t>& group, const Eigen::Vector3f& free)
      : sph(settings, material, position_m, fixed), group_(group), wanted_(sph.size(), Eigen::Vector4f::Zero()) {
    free_ << free, 0.0f;
    std::size_t groups = 0;
    for (const std::size_t g : group) groups = std::max(groups, g + 1);
    members_.assign(groups, 0.0f);
    for (const std::size_t g : group) members_[g] += 1.0f;
    driven_.assign(groups, 0);
    mean_.resize(groups);
  }

  /// From now on the group keeps this velocity, m/s, whatever pushes it.
  void drive(std::size_t group, const Eigen::Vector3d& velocity_mps) {
    driven_[group] = 1;
    for (std::size_t i = 0; i < sph.size(); ++i) {
      if (group_[i] == group) sph.setVelocity(i, velocity_mps);
    }
  }

  /// @param damping_per_s  mass damping, 1/s; not on driven groups
  /// @param external       N on particle i, as Vector4f with w = 0
  template <class ExternalForce>
  void step(double time_step_s, double damping_per_s, const ExternalForce& external) {
    sph.updateGradients();
    sph.updateStress(time_step_s);
    std::fill(mean_.begin(), mean_.end(), Eigen::Vector4f::Zero());
    const auto drag = static_cast<float>(damping_per_s * sph.particleMass());
    for (std::size_t i = 0; i < sph.size(); ++i) {
      if (sph.isFixed(i) || driven_[group_[i]] != 0) continue;
      mean_[group_[i]] += sph.internalForce(i) + external(i) - drag * sph.velocity(i);
    }
    for (std::size_t g = 0; g < mean_.size(); ++g) mean_[g] = mean_[g].cwiseProduct(free_) / members_[g];
    for (std::size_t i = 0; i < sph.size(); ++i) wanted_[i] = mean_[group_[i]];
    // What updateMotion() adds to this is the internal force, which leaves the wanted one.
    sph.updateMotion(time_step_s, 0.0,
                     [this](std::size_t i) { return Eigen::Vector4f(wanted_[i] - sph.internalForce(i)); });
    ASSERT_TRUE(sph.sound());
  }

  /// Force of the rest of the body on a group, N.
  Eigen::Vector3d forceOn(std::size_t group) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < sph.size(); ++i) {
      if (group_[i] == group) sum += sph.internalForce(i).head<3>().cast<double>();
    }
    return sum;
  }

  SphBody sph;

 private:
  std::vector<std::size_t> group_;
  std::vector<float> members_;
  std::vector<char> driven_;
  Eigen::Vector4f free_;
  AlignedVector<Eigen::Vector4f> mean_, wanted_;
};

}  // namespace brash_ice_rig
