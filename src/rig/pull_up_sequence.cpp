#include "brash_ice_rig/rig/pull_up_sequence.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "brash_ice_rig/config/number_check.h"

namespace brash_ice_rig {
namespace {

/// The hub counts as arrived when it is this close to its goal.
constexpr double kArrivedWithinM = 1.0e-3;
constexpr double kLongestS = 3600.0;  // as procedure.lift_duration_s

void checkField(const char* field, double value, const Range& range) {
  checkRange(field, value, formatNumber(value), range);
}

[[noreturn]] void refuse(const char* field, double value, const std::string& rule) {
  throw ConfigError(field, formatNumber(value), rule);
}

}  // namespace

void checkPullUpOrder(const PullUpOrder& order, const Scenario& scenario, double hub_height_m) {
  const CraneConfig& crane = scenario.crane;
  const double pole_m = scenario.collector.pole_length_m;
  checkField("depth_m", order.depth_m, Range{0.0});
  const bool lowers = order.depth_m > 0.0;
  checkField("lower_speed_mps", order.lower_speed_mps, Range{0.0, crane.max_speed_mps, lowers});
  checkField("lift_speed_mps", order.lift_speed_mps, Range{0.0, crane.max_speed_mps, true});
  checkField("lift_height_m", order.lift_height_m, Range{0.0});
  checkField("lift_duration_s", order.lift_duration_s, Range{0.0, kLongestS});
  checkField("hold_duration_s", order.hold_duration_s, Range{0.0, kLongestS});
  if ((order.lift_height_m > 0.0) == (order.lift_duration_s > 0.0)) {
    refuse("lift_height_m", order.lift_height_m,
           "one of lift_height_m and lift_duration_s must be > 0 and the other 0 (lift_duration_s = " +
               formatNumber(order.lift_duration_s) + ")");
  }

  if (lowers && order.depth_m < -hub_height_m - kArrivedWithinM) {
    refuse("depth_m", order.depth_m,
           "must be at least " + formatNumber(-hub_height_m) + ", where the hub hangs already; 0 lifts from there");
  }
  const double deepest_m = pole_m - crane.min_height_m;
  if (lowers && order.depth_m > deepest_m) {
    refuse("depth_m", order.depth_m,
           "must be at most " + formatNumber(deepest_m) + ", where the crane tip is at crane.min_height_m (" +
               formatNumber(crane.min_height_m) + ")");
  }
  const double room_m = crane.max_height_m - pole_m - (lowers ? -order.depth_m : hub_height_m);
  const std::string where = ", where the crane tip is at crane.max_height_m (" + formatNumber(crane.max_height_m) + ")";
  if (order.lift_height_m > room_m) {
    refuse("lift_height_m", order.lift_height_m, "must be at most " + formatNumber(room_m) + where);
  }
  if (order.lift_speed_mps * order.lift_duration_s > room_m) {
    refuse("lift_duration_s", order.lift_duration_s,
           "must be at most " + formatNumber(room_m / order.lift_speed_mps) + " at this speed" + where);
  }
  const double sample_period_s = 1.0 / scenario.load_cell.rate_hz;
  if (sample_period_s > crane.command_timeout_s) {
    throw ConfigError("crane.command_timeout_s", formatNumber(crane.command_timeout_s),
                      "must be at least the load cell's sample period (" + formatNumber(sample_period_s) +
                          "), because the action commands once per sample");
  }
}

const char* pullUpStageName(PullUpStage stage) {
  switch (stage) {
    case PullUpStage::kSettle:
      return "settle";
    case PullUpStage::kFold:
      return "fold";
    case PullUpStage::kLower:
      return "lower";
    case PullUpStage::kUnfold:
      return "unfold";
    case PullUpStage::kLift:
      return "lift";
    case PullUpStage::kHold:
      return "hold";
    case PullUpStage::kDone:
      return "done";
    case PullUpStage::kFailed:
      return "failed";
  }
  return "unknown";
}

PullUpSequence::PullUpSequence(const PullUpOrder& order, const CraneConfig& crane, double sample_period_s)
    : order_(order), max_acceleration_mps2_(crane.max_acceleration_mps2), sample_period_s_(sample_period_s) {
  assert(sample_period_s > 0.0);
}

void PullUpSequence::enter(PullUpStage stage, const Snapshot& snapshot) {
  stage_ = stage;
  stage_start_s_ = snapshot.time_s;
  if (stage == PullUpStage::kLift) lift_start_m_ = snapshot.rig.crane_hub_height_m;
}

void PullUpSequence::fail(const Snapshot& snapshot, const std::string& reason) {
  failure_ = std::string("stage ") + pullUpStageName(stage_) + ", fold ratio " +
             formatNumber(std::round(100.0 * snapshot.rig.fold_ratio) / 100.0) + ": " + reason;
  enter(PullUpStage::kFailed, snapshot);
}

/// Arms that are meant to carry the ice and cannot end the test, as in the field.
void PullUpSequence::checkMechanism(const Snapshot& snapshot, StatusFlags raised) {
  for (const StatusFlag trouble : {StatusFlag::kFoldJammed, StatusFlag::kFoldUnlocked}) {
    if (!raised.has(trouble)) continue;
    fail(snapshot, std::string(statusName(trouble)) + ": " + statusRemedy(trouble));
    return;
  }
}

/// The speed from which the crane still stops within a distance, if it learns of it one sample later:
/// v T + v²/(2 a) = distance.
double PullUpSequence::approachSpeed(double speed_mps, double distance_m) const {
  const double late = max_acceleration_mps2_ * sample_period_s_;
  const double distance = std::max(distance_m, 0.0);
  return std::min(speed_mps, std::sqrt(late * late + 2.0 * max_acceleration_mps2_ * distance) - late);
}

PullUpSequence::Drive PullUpSequence::step(const Snapshot& snapshot, StatusFlags raised) {
  const double half_sample = 0.5 * sample_period_s_;  // times are multiples of the sample, up to round-off
  const double hub_m = snapshot.rig.crane_hub_height_m;
  const auto elapsed = [&](double duration_s) { return snapshot.time_s - stage_start_s_ > duration_s - half_sample; };

  if (stage_ == PullUpStage::kSettle && snapshot.time_s > -half_sample) {
    enter(order_.fold_before_lowering ? PullUpStage::kFold : PullUpStage::kLower, snapshot);
  }
  if (stage_ == PullUpStage::kFold && snapshot.rig.fold_ratio <= 0.0) enter(PullUpStage::kLower, snapshot);
  if (stage_ == PullUpStage::kLower && (order_.depth_m <= 0.0 || hub_m + order_.depth_m < kArrivedWithinM)) {
    enter(order_.unfold_before_lifting ? PullUpStage::kUnfold : PullUpStage::kLift, snapshot);
  }
  if (stage_ == PullUpStage::kUnfold || stage_ == PullUpStage::kLift || stage_ == PullUpStage::kHold) {
    checkMechanism(snapshot, raised);
  }
  if (stage_ == PullUpStage::kUnfold && snapshot.rig.fold_ratio >= 1.0 && snapshot.rig.locked) {
    enter(PullUpStage::kLift, snapshot);
  }
  if (stage_ == PullUpStage::kLift &&
      (order_.lift_duration_s > 0.0 ? elapsed(order_.lift_duration_s)
                                    : lift_start_m_ + order_.lift_height_m - hub_m < kArrivedWithinM)) {
    enter(PullUpStage::kHold, snapshot);
  }
  if (stage_ == PullUpStage::kHold && elapsed(order_.hold_duration_s)) enter(PullUpStage::kDone, snapshot);

  Drive drive;
  if (stage_ == PullUpStage::kFold) drive.fold_target = 0.0;
  if (stage_ == PullUpStage::kUnfold) drive.fold_target = 1.0;
  if (stage_ == PullUpStage::kLower) {
    drive.hoist_speed_mps = -approachSpeed(order_.lower_speed_mps, hub_m + order_.depth_m);
  } else if (stage_ == PullUpStage::kLift) {
    drive.hoist_speed_mps = order_.lift_duration_s > 0.0
                                ? order_.lift_speed_mps
                                : approachSpeed(order_.lift_speed_mps, lift_start_m_ + order_.lift_height_m - hub_m);
  }
  return drive;
}

}  // namespace brash_ice_rig
