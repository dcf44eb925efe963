#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/material/material.h"
#include "brash_ice_rig/sph/neighbour_search.h"
#include "brash_ice_rig/system/state_visitor.h"

namespace brash_ice_rig {

/// When particles may sleep. SI.
struct ActiveSetSettings {
  bool enabled = false;        ///< without it all are awake, always
  double quiet_force_n = 0.0;  ///< what holding a particle in place may cost in force, > 0
  double quiet_way_m = 0.0;    ///< a particle that goes farther in quiet_time_s is not quiet, > 0
  double quiet_time_s = 0.0;   ///< how long particles must be quiet before they sleep, > 0
  double spacing_m = 0.0;      ///< side of a particle, > 0
  double time_step_s = 0.0;    ///< > 0
};

/// Which particles take part in a step.
///
/// Ice at rest whose stress does not change need not be computed: it sleeps, in groups of neighbours along the lattice.
/// A sleeping particle stays where it is, keeps its stress, and acts on others as if it were held in place. The force
/// that holds it is what this costs, and it is watched: every few steps, and where it exceeds quiet_force_n, the group
/// wakes up. A group falls asleep when each of its particles has, for quiet_time_s, gone no farther than quiet_way_m
/// and changed no component of its stress by more than quiet_force_n / spacing², in the mean over windows of some
/// samples, so that waves which run to and fro do not count. So the thresholds are one, seen from both sides, and its
/// ratio to a particle's weight bounds the error where what moves meets what rests.
class ActiveSet {
 public:
  struct Run {
    std::size_t begin, end;                       ///< particles
    std::size_t first_neighbour, last_neighbour;  ///< runs of awake() with its neighbours and itself lie between these
  };
  /// Runs [begin, end) of awake().
  struct Share {
    std::size_t begin, end;
    /// Whether a run and all its neighbours are in it.
    bool holds(std::size_t run, const Run& r) const {
      return run >= begin && run < end && r.first_neighbour >= begin && r.last_neighbour < end;
    }
  };
  static constexpr std::size_t kLongestRun = 64;

  /// @param fixed  particles that never move: no force wakes them
  ActiveSet(const ActiveSetSettings& settings, const std::vector<Eigen::Vector3d>& position_m,
            const std::vector<bool>& fixed);

  /// Awake particles in ascending order, in runs of at most kLongestRun.
  const std::vector<Run>& awake() const { return awake_; }
  /// Calls `act` with each run of which this one is the last neighbour.
  template <class Act>
  void forRunsCompletedBy(std::size_t run, const Act& act) const {
    for (std::size_t k = completed_begin_[run]; k < completed_begin_[run + 1]; ++k) act(completed_[k]);
  }
  /// One of `count` shares of awake(), with about the same number of particles each.
  Share share(std::size_t index, std::size_t count) const;
  /// Sleeping particles with a neighbour that is awake, likewise, in steps that sample; none in others.
  const std::vector<Run>& watched() const { return sampling_ ? border_ : none_; }
  bool isAwake(std::size_t i) const { return group_awake_[i / kGroup] != 0; }
  std::size_t awakeCount() const { return awake_count_; }

  /// Whether this step's stresses and forces are to be sampled.
  bool sampling() const { return sampling_; }
  /// Takes the stress of an awake particle into its mean.
  void sampleStress(std::size_t i, const std::array<std::vector<float>, kComponents>& stress) {
    for (std::size_t c = 0; c < kComponents; ++c) stress_sum_[i][c] += stress[c][i];
  }
  /// Notes whether the force on a watched particle, N, wakes it.
  void sampleForce(std::size_t i, const Eigen::Vector4f& force) {
    // Written so that what is not a number wakes it.
    const bool wakes = fixed_[i] == 0 && !(force.head<3>().squaredNorm() <= largest_force_ * largest_force_);
    pushed_[i] = wakes ? 1 : 0;
  }

  /// Wakes the group of a particle, from the end of the next step on.
  void wake(std::size_t i) {
    if (isAwake(i)) return;
    group_awake_[i / kGroup] = 1;
    quiet_for_[i / kGroup] = 0;
    woken_ = true;
  }

  /// To be called whenever they have changed, before the next endStep().
  void setNeighbours(const NeighbourList& neighbours);

  /// Ends a step: wakes groups, and lets others sleep.
  /// @param axis_m         of the rig, x and y; particles within `radius_m` of it do not sleep
  /// @param fallen_asleep  out: particles that have
  void endStep(const std::vector<Eigen::Vector3d>& position_m, const Eigen::Vector2d& axis_m, double radius_m,
               std::vector<std::size_t>& fallen_asleep);

  /// Between steps.
  /// @param neighbours  as last given to setNeighbours(); empty if none were
  void visitState(StateVisitor& visitor, const NeighbourList& neighbours);

 private:
  static constexpr std::size_t kGroup = 8;             // two columns of the default field
  static constexpr double kSamplePeriod = 0.0025;      // s; ice wakes up by a group in this time, some 200 m/s
  static constexpr std::uint64_t kShortestSample = 2;  // steps
  static constexpr std::uint64_t kSamples = 4;         // in a window

  using Stress = std::array<float, kComponents>;

  std::size_t groupEnd(std::size_t group) const { return std::min((group + 1) * kGroup, fixed_.size()); }
  bool isQuiet(std::size_t i, const Eigen::Vector3d& position_m) const;
  void setAnchor(std::size_t i, const Eigen::Vector3d& position_m);
  bool wakePushed();
  bool letSleep(const std::vector<Eigen::Vector3d>& position_m, const Eigen::Vector2d& axis_m, double radius_m,
                std::vector<std::size_t>& fallen_asleep);
  void makeRuns();
  void findNeighbourRuns();

  ActiveSetSettings settings_;
  std::vector<char> fixed_;
  std::uint64_t window_steps_ = 0, sample_steps_ = 0, quiet_windows_ = 0;
  float largest_force_;

  std::uint64_t step_ = 0;
  bool sampling_ = false;
  bool woken_ = false;  ///< by wake(), and not among the runs yet
  std::vector<char> group_awake_;
  std::vector<std::uint32_t> quiet_for_;  ///< windows, per group
  std::size_t awake_count_;

  // Per particle: sum over the window, what quietness is measured from, whether the last force wakes it.
  std::vector<Stress> stress_sum_, anchor_stress_;
  std::vector<Eigen::Vector3d> anchor_position_;
  std::vector<char> pushed_;

  std::vector<Run> awake_, border_, none_;
  std::vector<std::size_t> completed_begin_, completed_;  ///< runs by their last neighbour, in compressed rows
  std::vector<char> border_group_;
  // For each group those with a neighbour of one of its particles, in compressed rows.
  std::vector<std::size_t> group_row_, group_neighbour_;
  std::vector<std::size_t> lowest_neighbour_, highest_neighbour_;  ///< groups, per group
};

}  // namespace brash_ice_rig
