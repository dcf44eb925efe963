#include <algorithm>
#include <cmath>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/effects/effect.h"
#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// The pole does not go straight up: along one direction it moves by s(t) = u t + A sin(2 pi t / T), faded in from
/// time 0. It stays vertical; what a tilt changes in the net's shape is of second order in its angle.
class PoleTilt : public Effect {
 public:
  explicit PoleTilt(const EffectValues& values)
      : drift_(values["drift_mps"]),
        sway_(values["sway_m"]),
        frequency_(2.0 * kPi / values["sway_period_s"]),
        direction_(repeatable::cos(values["direction_deg"] * kPi / 180.0),
                   repeatable::sin(values["direction_deg"] * kPi / 180.0), 0.0) {}

  void updateSuspension(const RigNow& rig, Suspension& suspension) override {
    const double angle = frequency_ * rig.time_s;
    Motion path;
    path.position_m = (drift_ * rig.time_s + sway_ * repeatable::sin(angle)) * direction_;
    path.velocity_mps = (drift_ + sway_ * frequency_ * repeatable::cos(angle)) * direction_;
    path.acceleration_mps2 = -sway_ * frequency_ * frequency_ * repeatable::sin(angle) * direction_;
    suspension.point += fadeIn(path, rig.time_s);
  }

 private:
  double drift_, sway_, frequency_;
  Eigen::Vector3d direction_;
};

std::string rounded(double value) {
  return formatNumber(std::round(value * 1000.0) / 1000.0);
}

/// The collector has to stay clear of the fixed edge of the field until the script ends.
void checkPath(const EffectValues& values, const Scenario& scenario) {
  const double duration = scenario.procedure.lift_duration_s + scenario.procedure.hold_duration_s;
  const double way = std::abs(values["drift_mps"]) * duration + values["sway_m"];
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
      shape("direction_deg", "deg", 0.0, {-180.0, 180.0}, {PriorKind::kUniform, -180.0, 180.0},
            "direction of both, counted from x towards y"),
  };
  d.confusable_with = {"thickness_field", "vessel_heave"};
  d.how_to_tell = "a load cell with lateral channels, or a camera on the pole";
  d.acts_sideways = true;
  d.in_energy_balance = true;
  d.make = [](const EffectValues& values, const Scenario&) { return std::make_unique<PoleTilt>(values); };
  d.check = checkPath;
  return d;
}

}  // namespace brash_ice_rig
