#pragma once

#include <optional>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/rig/collector.h"
#include "brash_ice_rig/rig/crane.h"
#include "brash_ice_rig/rig/crane_motion.h"
#include "brash_ice_rig/simulation/snapshot.h"
#include "brash_ice_rig/system/state_visitor.h"

namespace brash_ice_rig {

/// The test as the crew runs it: settle, lower, unfold, lift, hold, done. A jammed collector ends it at unfold, as in
/// the field. In manual control only settle and manual occur, and done at the end of a file of commands.
class Procedure {
 public:
  /// @param lowest_hub_m  height of the hub at which lowering ends
  /// @throws ConfigError if there is a file of motion or commands and it cannot be used
  Procedure(const ProcedureConfig& config, double lowest_hub_m);

  struct Order {
    double hoist_speed_mps = 0.0;  ///< > 0 up
    double fold_target = 0.0;
  };

  /// Moves to the next stage when the present one is complete, and says what to do in the coming step.
  /// @param time_s  0 at the end of settling and rest
  Order step(double time_s, double time_step_s, const Crane& crane, const Collector& collector, double hub_height_m);

  Stage stage() const { return stage_; }

  void visitState(StateVisitor& visitor);

 private:
  void enter(Stage stage, double time_s);

  ProcedureConfig config_;
  double lowest_hub_m_;
  Stage stage_ = Stage::kSettle;
  double stage_start_s_ = 0.0;
  double fold_target_;
  std::optional<CraneMotion> motion_;
  std::optional<double> commands_end_s_;
};

}  // namespace brash_ice_rig
