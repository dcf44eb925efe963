#include "brash_ice_rig/simulation/status.h"

namespace brash_ice_rig {
namespace {

constexpr StatusFlag kAllFlags[] = {
    StatusFlag::kOverload,           StatusFlag::kCommandTimeout,  StatusFlag::kSpeedLimited,
    StatusFlag::kTravelLimit,        StatusFlag::kCommandRejected, StatusFlag::kCommandIgnored,
    StatusFlag::kMultipleCommanders, StatusFlag::kFoldJammed,      StatusFlag::kFoldUnlocked,
    StatusFlag::kContactSaturated,   StatusFlag::kNonFinite,       StatusFlag::kHoistSlack};

}  // namespace

const char* statusName(StatusFlag flag) {
  switch (flag) {
    case StatusFlag::kOverload:
      return "overload";
    case StatusFlag::kCommandTimeout:
      return "command_timeout";
    case StatusFlag::kSpeedLimited:
      return "speed_limited";
    case StatusFlag::kTravelLimit:
      return "travel_limit";
    case StatusFlag::kCommandRejected:
      return "command_rejected";
    case StatusFlag::kCommandIgnored:
      return "command_ignored";
    case StatusFlag::kMultipleCommanders:
      return "multiple_commanders";
    case StatusFlag::kFoldJammed:
      return "fold_jammed";
    case StatusFlag::kFoldUnlocked:
      return "fold_unlocked";
    case StatusFlag::kContactSaturated:
      return "contact_saturated";
    case StatusFlag::kNonFinite:
      return "non_finite";
    case StatusFlag::kHoistSlack:
      return "hoist_slack";
  }
  return "unknown";
}

const char* statusRemedy(StatusFlag flag) {
  switch (flag) {
    case StatusFlag::kOverload:
      return "The computer is slower than the wanted real-time factor, so simulated time lags. Lower "
             "real_time_factor, raise solver.threads, close other programs, or lower solver.stiffness_scale.";
    case StatusFlag::kCommandTimeout:
      return "No velocity command came within crane.command_timeout_s, so the crane stopped. Repeat the command "
             "faster than the timeout.";
    case StatusFlag::kSpeedLimited:
      return "The commanded speed is beyond crane.max_speed_mps and was cut. Command less, or raise the limit.";
    case StatusFlag::kTravelLimit:
      return "The crane is at an end of its travel and brakes. Move it the other way, or widen crane.min_height_m, "
             "crane.max_height_m, crane.max_reach_m.";
    case StatusFlag::kCommandRejected:
      return "A command was not a number, infinite or out of range and was refused; the crane stopped. Correct "
             "its sender.";
    case StatusFlag::kCommandIgnored:
      return "A command came while the script, or a file of commands, drives the crane. Set procedure.control to "
             "manual, without procedure.commands_file, to drive it yourself.";
    case StatusFlag::kMultipleCommanders:
      return "More than one publisher commands the crane, so no command counts and the crane stopped. Leave only "
             "one connected.";
    case StatusFlag::kFoldJammed:
      return "The arms stick before they are unfolded. Lift the collector out empty and repeat, or set "
             "collector.fault to none.";
    case StatusFlag::kFoldUnlocked:
      return "The arms are open but not locked and give way under load. Lift the collector out empty and repeat, "
             "or set collector.fault to none.";
    case StatusFlag::kContactSaturated:
      return "Ice was pressed more than halfway through the net's contact layer, so the force is too low. Raise "
             "contact.min_stiffness_npm or contact.stiffness_ratio.";
    case StatusFlag::kNonFinite:
      return "The numerical guard met what cannot be and froze the world at its last good step. Change what it names, "
             "or "
             "lower solver.cfl_ratio, and reset or run again.";
    case StatusFlag::kHoistSlack:
      return "The ice carries more than the rig weighs: a real rope would be slack, this one pushes. Lower more "
             "slowly, or raise collector.mass_kg.";
  }
  return "";
}

std::vector<StatusFlag> activeFlags(StatusFlags flags) {
  std::vector<StatusFlag> active;
  for (const StatusFlag flag : kAllFlags) {
    if (flags.has(flag)) active.push_back(flag);
  }
  return active;
}

}  // namespace brash_ice_rig
