#include <algorithm>
#include <cmath>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/effects/effect.h"
#include "brash_ice_rig/math/angle.h"
#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {
namespace {

/// The pole does not go straight up: along one direction its foot moves by
///   s(t) = u t + A (sin(2 pi t / T + phase) - sin(phase))
/// faded in from time 0. Where its top stays behind, the pole leans, and a load cell between hook and pole reads along
/// it: sideways
///   -tension s / length
/// and nothing of the ice, which is held by what moves the foot. Where the top moves along, the cell reads what the ice
/// resists. Net and contact stay as under an upright pole: what the angle changes there is of second order in it.
class PoleTilt : public Effect {
 public:
  PoleTilt(const EffectValues& values, double pole_length_m)
      : lean_(values["lean_ratio"]),
        pole_length_m_(pole_length_m),
        drift_(values["drift_mps"]),
        sway_(values["sway_m"]),
        frequency_(2.0 * kPi / values["sway_period_s"]),
        phase_(values["sway_phase_deg"] * kDegree),
        direction_(repeatable::cos(values["direction_deg"] * kPi / 180.0),
                   repeatable::sin(values["direction_deg"] * kPi / 180.0), 0.0) {}

  void updateSuspension(const RigNow& rig, Suspension& suspension) override {
    suspension.point += motionAt(rig.time_s);
  }

  void updateReading(double time_s, double /*time_step_s*/, Eigen::Vector3d& force_n) override {
    if (lean_ == 0.0) return;
    const Eigen::Vector3d leaning_n = -force_n.z() / pole_length_m_ * motionAt(time_s).position_m;
    force_n.head<2>() += lean_ * (leaning_n - force_n).head<2>();
  }

 private:
  Motion motionAt(double time_s) const {
    const double angle = frequency_ * time_s + phase_;
    Motion path;
    path.position_m = (drift_ * time_s + sway_ * (repeatable::sin(angle) - repeatable::sin(phase_))) * direction_;
    path.velocity_mps = (drift_ + sway_ * frequency_ * repeatable::cos(angle)) * direction_;
    path.acceleration_mps2 = -sway_ * frequency_ * frequency_ * repeatable::sin(angle) * direction_;
    return fadeIn(path, time_s);
  }

  double lean_, pole_length_m_, drift_, sway_, frequency_, phase_;
  Eigen::Vector3d direction_;
};

std::string rounded(double value) {
  return formatNumber(std::round(value * 1000.0) / 1000.0);
}

/// The collector has to stay clear of the fixed edge of the field until the script ends.
void checkPath(const EffectValues& values, const Scenario& scenario) {
  const double duration = scenario.procedure.lift_duration_s + scenario.procedure.hold_duration_s;
  const double swayed = values["sway_m"] * (1.0 + std::abs(repeatable::sin(values["sway_phase_deg"] * kDegree)));
  const double way = std::abs(values["drift_mps"]) * duration + swayed;
  const double side = std::min(scenario.field.length_x_m, scenario.field.length_y_m);
  const double room = 0.5 * side - 2.0 * scenario.field.spacing_m - scenario.collector.radius_m;
  if (way <= room + 1.0e-9) return;
  throw ConfigError("effects.pole_tilt.drift_mps", formatNumber(values["drift_mps"]),
                    "takes the collector " + rounded(way) + " m sideways with sway_m, at most " +
                        rounded(std::max(room, 0.0)) + " m are free in the field");
}

}  // namespace

EffectDescription describePoleTilt() {
  EffectDescription d;
  d.name = "pole_tilt";
  d.mechanism = "the pole moves sideways while it is lifted";
  d.parameters = {
      amplitude("drift_mps", "m/s", 0.005, {-0.2, 0.2}, {PriorKind::kNormal, 0.0, 0.005}, false,
                "steady speed sideways"),
      amplitude("sway_m", "m", 0.0, {0.0, 2.0}, {PriorKind::kHalfNormal, 0.0, 0.1}, false,
                "amplitude of swaying sideways"),
      shape("sway_period_s", "s", 15.0, {2.0, 300.0}, {PriorKind::kLogNormal, 15.0, 0.5}, "period of swaying"),
      shape("sway_phase_deg", "deg", 0.0, {-180.0, 180.0}, {PriorKind::kUniform, -180.0, 180.0},
            "where in its period it starts: at 0 fastest, at -90 from rest"),
      shape("direction_deg", "deg", 0.0, {-180.0, 180.0}, {PriorKind::kUniform, -180.0, 180.0},
            "direction of both, counted from x towards y"),
      setting(
          "lean_ratio", "1", 1.0, {0.0, 1.0},
          "1 = the top of the pole stays where it is and the pole leans, 0 = the top moves along; in between mixed"),
  };
  d.confusable_with = {"thickness_field", "vessel_heave"};
  d.how_to_tell = "a load cell with lateral channels, or a camera on the pole";
  d.acts_sideways = true;
  d.in_energy_balance = true;
  d.make = [](const EffectValues& values, const Scenario& scenario) {
    return std::make_unique<PoleTilt>(values, scenario.collector.pole_length_m);
  };
  d.check = checkPath;
  return d;
}

}  // namespace brash_ice_rig
