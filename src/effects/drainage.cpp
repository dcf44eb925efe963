#include <algorithm>
#include <cmath>

#include "brash_ice_rig/effects/effect.h"

#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {
namespace {

/// Water in the voids of ice that is lifted out of the sea weighs on the collector until it has drained.
///
/// As a particle's share above the waterline grows by da, its pores take the water rho_w V_pore h da along. What was
/// taken, w_0, then drains: exponential, w = w_0 exp(-t / tau), or by a square root, w = w_0 (1 - sqrt(t / tau)), which
/// ends at tau. For water taken at several times the square-root law goes on from the age that the share left stands
/// for: w / w_0 = 1 - q, q = sqrt(t / tau). Ice that sinks gives back the water of the part that sinks, which came out
/// last and is wettest, so that ice that only bobs gains none. Voids above the waterline at the start hold air.
/// The two laws bracket a column that drains freely: a diffusion of moisture starts as a square root of time; the
/// exponential is what Youngs (1960, Journal of Geophysical Research 65) gives for drainage under gravity.
class Drainage : public Effect {
 public:
  Drainage(const EffectValues& values, const Scenario& scenario)
      : held_ratio_(values["held_ratio"]),
        drain_time_(values["drain_time_s"]),
        square_root_(values["square_root"] != 0.0),
        density_(scenario.water.density_kgpm3) {}

  void updateIce(const IceNow& ice, IceChanges& changes) override {
    const std::size_t count = ice.position_m.size();
    const bool first = dry_.empty();
    if (first) {
      dry_.resize(count);
      taken_kg_.assign(count, 0.0);
      held_kg_.assign(count, 0.0);
    }
    const double decay = repeatable::exp(-ice.time_step_s / drain_time_);
    const double aged = ice.time_step_s / drain_time_;
    for (std::size_t i = 0; i < count; ++i) {
      const double dry = 1.0 - static_cast<double>(ice.water.submerged(static_cast<float>(ice.position_m[i].z())));
      const double before = first ? dry : dry_[i];
      dry_[i] = dry;
      if (held_kg_[i] > 0.0) {
        if (square_root_) {
          const double q = 1.0 - held_kg_[i] / taken_kg_[i];
          held_kg_[i] = taken_kg_[i] * (1.0 - std::min(std::sqrt(q * q + aged), 1.0));
        } else {
          held_kg_[i] *= decay;
        }
      }
      const double pores = density_ * static_cast<double>(ice.pore_volume_m3[i]) * held_ratio_;
      const double taken = pores * (dry - before);  // < 0: given back, the freshest first
      held_kg_[i] = std::max(held_kg_[i] + taken, 0.0);
      taken_kg_[i] = held_kg_[i] > 0.0 ? std::max(taken_kg_[i] + taken, held_kg_[i]) : 0.0;
      changes.held_water_kg[i] = static_cast<float>(held_kg_[i]);
    }
  }

  void visitState(StateVisitor& visitor) override {
    visitor("dry", dry_);
    visitor("taken_kg", taken_kg_);
    visitor("held_kg", held_kg_);
  }

 private:
  double held_ratio_, drain_time_;
  bool square_root_;
  double density_;
  std::vector<double> dry_;  // share above the waterline
  std::vector<double> taken_kg_, held_kg_;
};

}  // namespace

EffectDescription describeDrainage() {
  EffectDescription d;
  d.name = "drainage";
  d.mechanism = "lifted ice carries water in its voids, which drains";
  d.parameters = {
      amplitude("held_ratio", "1", 0.3, {0.0, 1.0}, {PriorKind::kHalfNormal, 0.0, 0.3}, true,
                "share of the voids' volume that holds water when it leaves the sea"),
      triedShape("drain_time_s", "s", 10.0, {0.1, 3600.0}, {PriorKind::kLogNormal, 10.0, 0.7},
                 "time constant of the exponential law; with square_root the time at which all has drained"),
      switchSetting("square_root", false, "drains with the square root of time instead of exponentially"),
  };
  d.confusable_with = {"block_drop", "load_cell_drift"};
  d.how_to_tell = "a hold after the lift: drainage goes on smoothly and then stops, blocks fall in steps";
  d.changes_mass = true;
  d.make = [](const EffectValues& values, const Scenario& scenario) {
    return std::make_unique<Drainage>(values, scenario);
  };
  return d;
}

}  // namespace brash_ice_rig
