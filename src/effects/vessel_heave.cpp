#include <array>
#include <cmath>
#include <string>

#include "brash_ice_rig/effects/effect.h"

#include "brash_ice_rig/math/angle.h"
#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {
namespace {

constexpr int kLines = 3;

/// The ship heaves and takes the crane along: z(t) = sum of A_k sin(2 pi t / T_k + phi_k), faded in from the end of
/// settling on: at sea it does not wait for the lift.
class VesselHeave : public Effect {
 public:
  VesselHeave(const EffectValues& values, double rest_s) : rest_s_(rest_s) {
    for (int k = 0; k < kLines; ++k) {
      const std::string number = std::to_string(k + 1);
      lines_[static_cast<std::size_t>(k)] = {values["amplitude_" + number + "_m"],
                                             2.0 * kPi / values["period_" + number + "_s"],
                                             values["phase_" + number + "_deg"] * kPi / 180.0};
    }
  }

  void updateSuspension(const RigNow& rig, Suspension& suspension) override {
    Motion swell;
    for (const Line& line : lines_) {
      const double angle = line.frequency * rig.time_s + line.phase;
      swell.position_m.z() += line.amplitude * repeatable::sin(angle);
      swell.velocity_mps.z() += line.amplitude * line.frequency * repeatable::cos(angle);
      swell.acceleration_mps2.z() -= line.amplitude * line.frequency * line.frequency * repeatable::sin(angle);
    }
    suspension.point += fadeIn(swell, rig.time_s + rest_s_);
  }

 private:
  struct Line {
    double amplitude, frequency, phase;  // m, rad/s, rad
  };
  std::array<Line, kLines> lines_{};
  double rest_s_;
};

}  // namespace

EffectDescription describeVesselHeave() {
  const Range amplitudes{0.0, 1.0}, periods{1.0, 60.0}, phases{-360.0, 360.0};
  const Prior small{PriorKind::kHalfNormal, 0.0, 0.03}, any_phase{PriorKind::kUniform, -180.0, 180.0};
  EffectDescription d;
  d.name = "vessel_heave";
  d.mechanism = "the ship heaves and moves the suspension point up and down";
  d.parameters = {
      amplitude("amplitude_1_m", "m", 0.02, amplitudes, small, false, "amplitude of the first spectral line"),
      shape("period_1_s", "s", 6.0, periods, {PriorKind::kLogNormal, 6.0, 0.3}, "its period"),
      shape("phase_1_deg", "deg", 0.0, phases, any_phase, "its phase at time 0; 0 rises through the middle"),
      amplitude("amplitude_2_m", "m", 0.0, amplitudes, small, false, "amplitude of the second spectral line"),
      shape("period_2_s", "s", 9.0, periods, {PriorKind::kLogNormal, 9.0, 0.3}, "its period"),
      shape("phase_2_deg", "deg", 0.0, phases, any_phase, "its phase at time 0"),
      amplitude("amplitude_3_m", "m", 0.0, amplitudes, small, false, "amplitude of the third spectral line"),
      shape("period_3_s", "s", 4.0, periods, {PriorKind::kLogNormal, 4.0, 0.3}, "its period"),
      shape("phase_3_deg", "deg", 0.0, phases, any_phase, "its phase at time 0"),
  };
  d.confusable_with = {"pole_tilt"};
  d.how_to_tell =
      "a position measured against the shore, or a motion sensor on board; drum ripple has the period of the "
      "drum's turns instead and follows the hoist speed";
  d.in_energy_balance = true;
  d.acts_at_rest = true;
  d.make = [](const EffectValues& values, const Scenario& scenario) {
    return std::make_unique<VesselHeave>(values, scenario.procedure.rest_duration_s);
  };
  return d;
}

}  // namespace brash_ice_rig
