#pragma once

#include <optional>
#include <string>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/simulation/snapshot.h"

namespace brash_ice_rig {

/// What one pull-up is to do, as whoever sits at the crane would be told. SI.
struct PullUpOrder {
  bool fold_before_lowering = false;   ///< fold the arms where the collector hangs
  double depth_m = 0.0;                ///< hub below the still waterline after lowering; 0: do not lower
  double lower_speed_mps = 0.0;        ///< > 0 if depth_m > 0
  bool unfold_before_lifting = false;  ///< open the arms below the ice
  double lift_speed_mps = 0.0;         ///< > 0
  double lift_height_m = 0.0;          ///< one of these two is > 0, the other 0
  double lift_duration_s = 0.0;        ///< rounded up to whole samples
  double hold_duration_s = 0.0;        ///< hang still after the lift; rounded up to whole samples
};

/// Checks an order against the crane's limits and where the rig hangs.
/// @param hub_height_m  RigState::crane_hub_height_m
/// @throws ConfigError naming field, value and rule
void checkPullUpOrder(const PullUpOrder& order, const Scenario& scenario, double hub_height_m);

enum class PullUpStage { kSettle, kFold, kLower, kUnfold, kLift, kHold, kDone, kFailed };

/// Lower-case name, e.g. "lift".
const char* pullUpStageName(PullUpStage stage);

/// Drives crane and fold through one pull-up by the commands of manual control. Decides once per sample of the load
/// cell, by simulated time and what the rig shows, so that an order given at one sample always has the same result. A
/// lift from time 0 gives the same bits as the script with the same speed and duration.
class PullUpSequence {
 public:
  /// @param order  has passed checkPullUpOrder()
  /// @param sample_period_s  time between two step(), > 0
  PullUpSequence(const PullUpOrder& order, const CraneConfig& crane, double sample_period_s);

  struct Drive {
    double hoist_speed_mps = 0.0;  ///< > 0 up; to be commanded at every sample, 0 included
    std::optional<double> fold_target;
  };

  /// Moves to the next stage when the present one is complete, and says what to command until the next sample.
  /// @param raised  flags of the time since the sample before
  Drive step(const Snapshot& snapshot, StatusFlags raised);

  PullUpStage stage() const { return stage_; }
  /// Done or failed; the crane is told to stop.
  bool finished() const { return stage_ == PullUpStage::kDone || stage_ == PullUpStage::kFailed; }
  /// Once failed: in which stage, what, and the remedy.
  const std::string& failure() const { return failure_; }

 private:
  void enter(PullUpStage stage, const Snapshot& snapshot);
  void fail(const Snapshot& snapshot, const std::string& reason);
  void checkMechanism(const Snapshot& snapshot, StatusFlags raised);
  double approachSpeed(double speed_mps, double distance_m) const;

  PullUpOrder order_;
  double max_acceleration_mps2_, sample_period_s_;
  PullUpStage stage_ = PullUpStage::kSettle;
  double stage_start_s_ = 0.0;
  double lift_start_m_ = 0.0;
  std::string failure_;
};

}  // namespace brash_ice_rig
