#include <cmath>

#include "brash_ice_rig/effects/effect.h"

namespace brash_ice_rig {
namespace {

/// A rope that gives: tension T = T_0 + k u + c u' for a stretch u beyond that under the hanging rig (T_0). The rig,
/// with the water that moves along, obeys m (a_point - u'') = T - L, with L the load of weight, buoyancy, ice and
/// water on it. Vertical only. Like the rigid link of the baseline it could push; the status reports a slack hoist.
class Compliance : public Effect {
 public:
  Compliance(double compliance_mpn, double damping_ratio)
      : compliance_(compliance_mpn), damping_ratio_(damping_ratio) {}

  void updateSuspension(const RigNow& rig, Suspension& suspension) override {
    if (compliance_ == 0.0) return;
    const double dt = rig.time_step_s, stiffness = 1.0 / compliance_;
    const double mass = rig.mass_kg + rig.added_mass_kg;
    const double damping = 2.0 * damping_ratio_ * std::sqrt(stiffness * mass);
    if (started_ == 0.0) hanging_ = rig.weight_n - rig.buoyancy_n;
    started_ = 1.0;
    const double load = rig.weight_n - rig.buoyancy_n - rig.ice_force_n.z() - rig.load_n.z();
    const double carried = rig.crane_acceleration_mps2.z() + suspension.point.acceleration_mps2.z();

    // Midpoint rule in stretch and speed: stable for any stiffness, and it takes no energy from the oscillation.
    const double push = load - hanging_ + mass * carried;
    const double before = speed_;
    speed_ = (mass * before + dt * (push - stiffness * (stretch_ + 0.25 * dt * before) - 0.5 * damping * before)) /
             (mass + 0.5 * dt * damping + 0.25 * dt * dt * stiffness);
    const double middle = 0.5 * (before + speed_);
    suspension.tension_n = hanging_ + stiffness * (stretch_ + 0.5 * dt * middle) + damping * middle;
    stretch_ += dt * middle;

    suspension.stretch.position_m.z() -= stretch_;
    suspension.stretch.velocity_mps.z() -= speed_;
    suspension.stretch.acceleration_mps2.z() -= (speed_ - before) / dt;
  }

  void visitState(StateVisitor& visitor) override {
    visitor("started", started_);
    visitor("hanging_n", hanging_);
    visitor("stretch_m", stretch_);
    visitor("speed_mps", speed_);
  }

 private:
  double compliance_, damping_ratio_;
  double started_ = 0.0;
  double hanging_ = 0.0;  // N
  double stretch_ = 0.0, speed_ = 0.0;
};

}  // namespace

EffectDescription describeCompliance() {
  EffectDescription d;
  d.name = "compliance";
  d.mechanism = "rope and net stretch under load";
  d.parameters = {
      amplitude("compliance_mpn", "m/N", 3.0e-6, {0.0, 1.0e-3}, {PriorKind::kHalfNormal, 0.0, 5.0e-6}, true,
                "stretch per load, 1 / stiffness"),
      shape("damping_ratio", "1", 0.05, {0.0, 2.0}, {PriorKind::kLogNormal, 0.05, 0.7},
            "damping over the critical damping of the rig alone"),
  };
  d.confusable_with = {"crane_speed", "load_cell_lag"};
  d.how_to_tell = "a stop or a reversal, or the oscillation after it; known weights give the stretch directly";
  d.make = [](const EffectValues& values, const Scenario&) {
    return std::make_unique<Compliance>(values["compliance_mpn"], values["damping_ratio"]);
  };
  return d;
}

}  // namespace brash_ice_rig
