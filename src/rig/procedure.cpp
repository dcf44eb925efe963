#include "brash_ice_rig/rig/procedure.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "brash_ice_rig/rig/rig_commands.h"

namespace brash_ice_rig {
namespace {

/// The hub counts as lowered when it is this close to its goal.
constexpr double kLoweredWithinM = 1.0e-3;

}  // namespace

const char* stageName(Stage stage) {
  switch (stage) {
    case Stage::kSettle:
      return "settle";
    case Stage::kLower:
      return "lower";
    case Stage::kUnfold:
      return "unfold";
    case Stage::kLift:
      return "lift";
    case Stage::kHold:
      return "hold";
    case Stage::kDone:
      return "done";
    case Stage::kManual:
      return "manual";
  }
  return "unknown";
}

Procedure::Procedure(const ProcedureConfig& config, double lowest_hub_m)
    : config_(config),
      lowest_hub_m_(lowest_hub_m),
      fold_target_(config.start == StartPose::kUnfoldedUnderIce ? 1.0 : 0.0) {
  if (!config.commands_file.empty()) commands_end_s_ = readCommands(config.commands_file).back().time_s;
  if (!config.motion_file.empty()) motion_ = CraneMotion::read(config.motion_file);
}

void Procedure::enter(Stage stage, double time_s) {
  stage_ = stage;
  stage_start_s_ = time_s;
}

Procedure::Order Procedure::step(double time_s, double time_step_s, const Crane& crane, const Collector& collector,
                                 double hub_height_m) {
  const double half_step = 0.5 * time_step_s;  // times are multiples of the step, up to round-off
  if (stage_ == Stage::kSettle && time_s > -half_step) {
    if (config_.control == ControlMode::kManual) {
      enter(Stage::kManual, time_s);
    } else {
      enter(config_.start == StartPose::kUnfoldedUnderIce ? Stage::kLift : Stage::kLower, time_s);
    }
  }
  if (stage_ == Stage::kManual && commands_end_s_ && time_s > *commands_end_s_ - half_step) enter(Stage::kDone, time_s);
  if (stage_ == Stage::kLower && hub_height_m - lowest_hub_m_ < kLoweredWithinM) enter(Stage::kUnfold, time_s);
  if (stage_ == Stage::kUnfold) {
    fold_target_ = 1.0;
    if (collector.foldRatio() >= 1.0) {
      enter(Stage::kLift, time_s);
    } else if (collector.jammed()) {
      enter(Stage::kDone, time_s);
    }
  }
  const double lift_duration = motion_ ? motion_->duration() : config_.lift_duration_s;
  if (stage_ == Stage::kLift && time_s - stage_start_s_ > lift_duration - half_step) {
    enter(Stage::kHold, time_s);
  }
  if (stage_ == Stage::kHold && time_s - stage_start_s_ > config_.hold_duration_s - half_step) {
    enter(Stage::kDone, time_s);
  }

  Order order;
  order.fold_target = fold_target_;
  if (stage_ == Stage::kLower) {
    order.hoist_speed_mps =
        -std::min(config_.lower_speed_mps, crane.stoppingSpeed(hub_height_m - lowest_hub_m_, time_step_s));
  } else if (stage_ == Stage::kLift && motion_) {
    // Not steered by the height: what slows the hoist under load must be seen. Ramps cost a little way at a start and
    // give it back at the stop.
    const double lift_time = time_s - stage_start_s_;
    order.hoist_speed_mps = (motion_->wayAt(lift_time + time_step_s) - motion_->wayAt(lift_time)) / time_step_s;
  } else if (stage_ == Stage::kLift) {
    order.hoist_speed_mps = config_.lift_speed_mps;
  }
  return order;
}

void Procedure::visitState(StateVisitor& visitor) {
  auto stage = static_cast<std::uint32_t>(stage_);
  visitor("stage", stage);
  if (stage > static_cast<std::uint32_t>(Stage::kManual)) visitor.refuse("there is no such stage of the procedure");
  stage_ = static_cast<Stage>(stage);
  visitor("stage_start_s", stage_start_s_);
  visitor("fold_target", fold_target_);
  if (!motion_) return;
  const std::uint64_t present_motion = motion_->hash();
  std::uint64_t motion = present_motion;
  visitor("motion", motion);
  if (motion != present_motion) {
    visitor.refuse("procedure.motion_file, " + config_.motion_file + ", has changed since it was saved");
  }
}

}  // namespace brash_ice_rig
