#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/StdVector>

#include "brash_ice_rig/material/material.h"
#include "brash_ice_rig/sph/active_set.h"
#include "brash_ice_rig/sph/neighbour_search.h"
#include "brash_ice_rig/sph/sph_kernels.h"

namespace brash_ice_rig {

template <class T>
using AlignedVector = std::vector<T, Eigen::aligned_allocator<T>>;

/// How the continuum is cut into particles. SI.
struct SphSettings {
  double particle_volume_m3 = 0.0;    ///< at rest, V_0
  double density_kgpm3 = 0.0;         ///< bulk density at rest, rho
  double smoothing_length_m = 0.0;    ///< h, of all particles or at rest
  double viscosity_ratio = 0.1;       ///< alpha of the Monaghan viscosity
  double viscosity_speed_mps = 58.0;  ///< c in the viscosity; fixed, see doc/theory.md
  /// No particle's neighbours, held still, would brake it faster than this, 1/s: what goes beyond is left out.
  double largest_viscous_rate_ps = std::numeric_limits<double>::infinity();
  double volume_ratio_limit = 1.5;    ///< V / V_0 stays within 1/this .. this
  double determinant_limit = 0.1;     ///< below: no gradient correction
  double skin_m = 0.12;               ///< margin of the neighbour search
  double refresh_distance_m = 0.003;  ///< gradients are recomputed around a particle that has moved this far
  /// Each particle's h follows its volume by smoothingGrowth().
  bool variable_smoothing_length = false;
  ActiveSetSettings active_set;
  /// No ice can be faster, m/s: only a broken integration gets there. The default: ice that falls 50 m in air reaches a
  /// third of it.
  float fastest_mps = 100.0f;
};

/// Where the integration of a body broke down: the first particle, by number, of the step in which one did.
struct Breakdown {
  std::size_t particle = 0;
  double speed_mps = 0.0;      ///< that it would have had; NaN, infinite, or too large
  double volume_growth = 0.0;  ///< change of its volume in this step, ratio
};

/// A body of renormalised total-stress SPH particles (doc/theory.md, section SPH):
///   M_i = sum_j V_j (x_j - x_i) (x) grad W_ij,  B_i = M_i^-1
///   L_i = [sum_j V_j (v_j - v_i) (x) grad W_ij] B_i
///   f_i = V_i sum_j V_j (sigma_i B_i + sigma_j B_j) grad_i W_ij + viscosity
/// W_ij takes the mean of the two smoothing lengths, (h_i + h_j) / 2, so that grad_i W_ij = -grad_j W_ij in any case.
/// Pair forces are antisymmetric, so that linear momentum is conserved, and the force is the virtual-work adjoint of L,
/// so that angular momentum and energy are.
///
/// Gradients, B and the volumes in them are cached. They see a particle at its reference, where it was when it had last
/// moved a given distance, so that only rows with a neighbour on the move are computed anew.
/// Each particle gathers from its neighbours in a fixed order: results do not depend on the number of threads. The
/// sweeps themselves are in sph_kernels.h.
///
/// Functions marked "team" are called by every thread of an OpenMP team together; from a single thread they work too.
class SphBody {
 public:
  /// @param material  must outlive the body
  /// @param fixed     particles that never move; stress is followed in them all the same
  SphBody(const SphSettings& settings, const Material& material, const std::vector<Eigen::Vector3d>& position_m,
          const std::vector<bool>& fixed);
  SphBody(SphBody&&) = default;
  SphBody(const SphBody&) = delete;

  /// Largest change of a particle's volume in one step, ratio. V (1 + tr e) is of first order in the strain increment:
  /// far below this it has lost its meaning, and at -1 the particle would be gone.
  static constexpr float kLargestVolumeGrowth = 0.5f;

  std::size_t size() const { return position_.size(); }
  double particleMass() const { return settings_.density_kgpm3 * settings_.particle_volume_m3; }

  /// Team. Refreshes cached gradients if particles have moved far enough since the last time.
  void updateGradients();

  /// Team. Velocity gradient, rotation of stress, volumes, material, and the internal forces from them.
  void updateStress(double time_step_s);

  /// Team. Internal forces plus `external(i)` (N, as Vector4f with w = 0), then v and x by symplectic Euler.
  /// A particle whose new velocity would be beyond settings.fastest_mps, or not a number, keeps its place and velocity,
  /// and sound() turns false; it does, too, where a volume has changed by more than kLargestVolumeGrowth.
  /// @param damping_per_s  mass damping, 1/s
  /// @param then           called by one thread when all particles have moved
  template <class ExternalForce, class Then>
  void updateMotion(double time_step_s, double damping_per_s, const ExternalForce& external, const Then& then) {
    const auto dt = static_cast<float>(time_step_s);
    const float decay = 1.0f - static_cast<float>(damping_per_s * time_step_s);
    const float dt_over_mass = static_cast<float>(time_step_s / particleMass());
    const float bound_squared = settings_.fastest_mps * settings_.fastest_mps;
    float fastest_squared = 0.0f;
    std::optional<Breakdown> breakdown;
    const bool sampling = active_.sampling();
    // Who has computed a force moves the particle, so that neither waits for the other.
    const ActiveSet::Share share = ownShare();
    for (std::size_t run = share.begin; run < share.end; ++run) {
      float square_sum = 0.0f;
      const bool odd = odd_growth_[run] != 0;
      for (std::size_t i = active_.awake()[run].begin; i < active_.awake()[run].end; ++i) {
        if (sampling) active_.sampleStress(i, stress_);
        if (fixed_[i]) continue;
        const float push = inertia_ratio_.empty() ? dt_over_mass : dt_over_mass / inertia_ratio_[i];
        const Eigen::Vector4f velocity = velocity_[i] * decay + push * (force_[i] + external(i));
        const float speed_squared = velocity.head<3>().squaredNorm();
        // Written so that NaN is caught, too.
        if (!(speed_squared < bound_squared) || (odd && !growsWithinBounds(i))) {
          if (!breakdown) breakdown = Breakdown{i, std::sqrt(static_cast<double>(speed_squared)), volumeGrowth(i)};
          continue;
        }
        fastest_squared = std::max(fastest_squared, speed_squared);
        square_sum += speed_squared;
        velocity_[i].head<3>() = velocity.head<3>();
        position_[i] += (dt * velocity.head<3>()).template cast<double>();
      }
      square_sums_[run] = square_sum;
    }
#pragma omp for schedule(static) nowait
    for (std::size_t run = 0; run < active_.watched().size(); ++run) {  // NOLINT(modernize-loop-convert): for OpenMP
      for (std::size_t i = active_.watched()[run].begin; i < active_.watched()[run].end; ++i) {
        active_.sampleForce(i, force_[i] + external(i));
      }
    }
#pragma omp critical(brash_ice_rig_sph_motion)
    {
      fastest_squared_ = std::max(fastest_squared_, fastest_squared);
      if (breakdown && (!breakdown_ || breakdown->particle < breakdown_->particle)) breakdown_ = breakdown;
    }
#pragma omp barrier
#pragma omp single
    {
      unchecked_way_ += time_step_s * std::sqrt(static_cast<double>(fastest_squared_));
      fastest_squared_ = 0.0f;
      speed_squared_sum_ = 0.0;
      for (std::size_t run = 0; run < active_.awake().size(); ++run) {
        speed_squared_sum_ += static_cast<double>(square_sums_[run]);
      }
      updateActiveSet();
      then();
    }
  }
  template <class ExternalForce>
  void updateMotion(double time_step_s, double damping_per_s, const ExternalForce& external) {
    updateMotion(time_step_s, damping_per_s, external, [] {});
  }

  /// Particles within this distance of a vertical axis do not sleep; none at first. One thread.
  void keepAwake(const Eigen::Vector2d& axis_m, double radius_m) {
    awake_axis_ = axis_m;
    awake_radius_ = radius_m;
  }
  /// Wakes a particle that has changed from outside. One thread, between steps.
  void wake(std::size_t i) {
    active_.wake(i);
  }
  const ActiveSet& activeSet() const {
    return active_;
  }

  /// False after updateMotion() met what cannot be: the integration has broken down.
  bool sound() const {
    return !breakdown_;
  }
  /// Where it did.
  const std::optional<Breakdown>& breakdown() const {
    return breakdown_;
  }
  /// Puts zero, or the volume at rest, where a state is not finite: what is left of a body that broke down can be
  /// shown. One thread.
  void clearNonFinite();

  /// Sum of the particles' squared speeds after updateMotion(), m²/s², to single precision. It is summed run by run and
  /// does not depend on the number of threads.
  double speedSquaredSum() const {
    return speed_squared_sum_;
  }

  /// N, from stress and viscosity, of the last updateStress(); w = 0.
  const Eigen::Vector4f& internalForce(std::size_t i) const {
    return force_[i];
  }
  /// N, the part of it that is viscosity; w = 0.
  Eigen::Vector4f viscousForce(std::size_t i) const {
    return cached_volume_[i] * viscosity_[i];
  }

  const std::vector<Eigen::Vector3d>& position() const {
    return position_;
  }
  /// m/s, w = 0.
  Eigen::Vector4f velocity(std::size_t i) const {
    return {velocity_[i].x(), velocity_[i].y(), velocity_[i].z(), 0.0f};
  }
  /// In the order of material.h, Pa, tension positive.
  const std::array<std::vector<float>, kComponents>& stress() const {
    return stress_;
  }
  /// One array per entry of the material's stateNames().
  const std::vector<std::vector<float>>& state() const {
    return state_;
  }
  const std::vector<float>& volume() const {
    return volume_;
  }
  /// h_i in the cached gradients, m.
  const std::vector<double>& smoothingLength() const {
    return smoothing_length_;
  }
  bool isFixed(std::size_t i) const {
    return fixed_[i] != 0;
  }

  /// Velocity gradient dv_a/dx_b of particle i, 1/s, from the cached gradients and the present velocities.
  Eigen::Matrix3f velocityGradient(std::size_t i) const;

  /// Sets the velocity of a particle, m/s. For initial conditions.
  void setVelocity(std::size_t i, const Eigen::Vector3d& velocity_mps);
  /// Sets the stress of a particle, Pa. For initial conditions.
  void setStress(std::size_t i, const std::array<float, kComponents>& stress_pa);
  /// Sets the volume of a particle, m³, > 0. For initial conditions, before the first updateGradients().
  void setVolume(std::size_t i, double volume_m3);

  /// Inertia of each particle over particleMass(), > 0; empty: 1 for all. May be changed between steps.
  std::vector<float>& inertiaRatio() {
    return inertia_ratio_;
  }
  /// The array of one of the material's states, to be changed between steps.
  /// @param k  its place in stateNames()
  std::vector<float>& state(std::size_t k) {
    return state_[k];
  }

  /// Between steps, one thread. Loading refuses what would lead beyond memory: positions that are not finite, or ice
  /// so dense that lists of neighbours have no bound.
  void visitState(StateVisitor& visitor);

 private:
  /// Change of a particle's volume in this step, ratio.
  float volumeGrowth(std::size_t i) const {
    return strain_increment_[0][i] + strain_increment_[1][i] + strain_increment_[2][i];
  }
  /// Not where it is NaN.
  bool growsWithinBounds(std::size_t i) const {
    return std::abs(volumeGrowth(i)) < kLargestVolumeGrowth;
  }
  ActiveSet::Share ownShare() const;
  SphRows rows();
  void checkMoves();
  void takeReferences();
  void takeCandidates();
  void spreadCrowds();
  void findLongestRow();
  void listAllRows();
  void listDueRows();
  void refreshDueRows();
  void makeRoomForRows();
  template <class Act>
  void forCandidates(std::size_t i, const Act& act) const {
    for (std::size_t c = candidates_.row_begin[i]; c < candidates_.row_begin[i + 1]; ++c) {
      act(static_cast<std::size_t>(candidates_.index[c]));
    }
  }
  void setSite(std::size_t i);
  bool refreshRow(const SphSites& sites, std::size_t i, std::int32_t* scratch);
  bool updateRun(const SphRows& rows, const ActiveSet::Run& run, float time_step_s);
  void updateActiveSet();
  void checkLoaded(const StateVisitor& visitor) const;
  std::uint64_t hashOfRows() const;
  void rebuildRows();

  SphSettings settings_;
  const Material& material_;
  const SphKernels& kernels_;

  std::vector<Eigen::Vector3d> position_;
  /// m/s; w is a cached share of the viscosity, see refreshRow(), and stands here because kernels read both at once.
  AlignedVector<Eigen::Vector4f> velocity_;
  std::array<std::vector<float>, kComponents> stress_;
  std::vector<std::vector<float>> state_;
  std::vector<float> volume_;
  std::vector<char> fixed_;
  std::vector<float> inertia_ratio_;

  std::array<std::vector<float>, kComponents> strain_increment_;
  std::vector<CorrectedStress> corrected_stress_;
  AlignedVector<Eigen::Vector4f> viscosity_;  ///< viscous force over V_i, w = 0
  AlignedVector<Eigen::Vector4f> force_;      ///< internal force, w = 0
  std::vector<float*> tensors_;               ///< the arrays of state_ that turn with the particle

  // Cache, a function of the references alone.
  std::vector<Eigen::Vector3d> reference_;
  AlignedVector<SphSite> site_;  ///< the references as the kernels read them
  double site_unit_m_ = 0.0;
  NeighbourSearch search_;
  bool search_due_ = false;
  NeighbourList candidates_;  ///< within the longest support + skin
  std::vector<PairBlock> blocks_;
  std::vector<std::size_t> block_begin_;
  std::vector<std::int32_t> block_count_;
  std::array<std::vector<float>, 9> correction_;  ///< B_i, row by row
  AlignedVector<Eigen::Vector4f> gradient_sum_;   ///< sum_j V_j grad W_ij, w = 0
  std::vector<float> cached_volume_;
  std::vector<double> smoothing_length_;  ///< h_i

  /// How far a particle has left its reference: hardly, half of the way that counts (and with a neighbour), or all of
  /// it.
  enum : char { kStays, kHalfMoved, kTakenAlong, kMoved };
  std::vector<char> moved_;
  std::vector<char> listed_;                        ///< per particle: its row is due
  std::vector<std::size_t> due_;                    ///< rows to refresh in this step
  bool row_overflows_ = false;                      ///< a row has become longer than its place in blocks_
  std::size_t longest_row_ = 0;                     ///< of candidates_
  bool any_moved_ = false;                          ///< found by checkMoves()
  double farthest_squared_ = 0.0;                   ///< likewise: largest way since the search, squared
  std::vector<Eigen::Vector3d> searched_position_;  ///< where candidates_ were found
  double longest_ = 0.0, longest_at_search_ = 0.0;  ///< largest h_i since then, and at that time
  double unchecked_way_ = 0.0;                      ///< upper bound of any particle's way since checkMoves()

  ActiveSet active_;
  Eigen::Vector2d awake_axis_ = Eigen::Vector2d::Zero();
  double awake_radius_ = 0.0;
  std::vector<std::size_t> fallen_asleep_;

  float fastest_squared_ = 0.0f;
  std::optional<Breakdown> breakdown_;
  std::vector<char> odd_growth_;    ///< per run of those that are awake: a volume has changed by too much
  std::vector<float> square_sums_;  ///< of the speeds in each run of those that are awake; who sleeps does not move
  double speed_squared_sum_ = 0.0;
};

}  // namespace brash_ice_rig
