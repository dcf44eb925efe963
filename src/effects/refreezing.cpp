#include <algorithm>
#include <cmath>

#include "brash_ice_rig/effects/effect.h"

#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {
namespace {

constexpr double kReferenceTimeS = 600.0;

/// Blocks that rest freeze together again, from the surface down. Ice at rest for a time w is stronger by
///   growth_ratio sqrt(w / 600 s) exp(-depth / depth_m),
/// with the depth below the ice's top where the ice lay at first: a layer of ice grows with the square root of time
/// under a constant frost (Stefan 1891). Shear takes bonds away: over a plastic strain de the gain falls by
/// exp(-de / break_strain), that is, w falls by the square of it.
class Refreezing : public Effect {
 public:
  Refreezing(const EffectValues& values, const Scenario& scenario)
      : growth_ratio_(values["growth_ratio"]),
        waiting_(values["waiting_s"]),
        depth_(values["depth_m"]),
        break_strain_(values["break_strain"]),
        top_(latticeThickness(scenario.field) - iceDraft(scenario)) {}

  void updateIce(const IceNow& ice, IceChanges& changes) override {
    const std::size_t count = ice.plastic_strain.size();
    if (rested_s_.empty()) {
      // It has waited for the whole of the given time when the test begins; settling is part of that.
      rested_s_.assign(count, std::max(waiting_ + std::min(ice.time_s, 0.0), 0.0));
      strain_ = ice.plastic_strain;
      for (const Eigen::Vector3d& site : ice.site_m) {
        reach_.push_back(growth_ratio_ * repeatable::exp(-std::max(top_ - site.z(), 0.0) / depth_));
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      rested_s_[i] += ice.time_step_s;
      if (ice.plastic_strain[i] > strain_[i]) {
        const double sheared = static_cast<double>(ice.plastic_strain[i]) - static_cast<double>(strain_[i]);
        rested_s_[i] *= repeatable::exp(-2.0 * sheared / break_strain_);
        strain_[i] = ice.plastic_strain[i];
      }
      changes.strength_ratio[i] += static_cast<float>(reach_[i] * std::sqrt(rested_s_[i] / kReferenceTimeS));
    }
  }

  void visitState(StateVisitor& visitor) override {
    visitor("rested_s", rested_s_);
    visitor("strain", strain_);
    visitor("reach", reach_);
  }

 private:
  double growth_ratio_, waiting_, depth_, break_strain_, top_;
  std::vector<double> rested_s_;
  std::vector<float> strain_;
  std::vector<double> reach_;  // growth_ratio at the depth of each particle
};

}  // namespace

EffectDescription describeRefreezing() {
  EffectDescription d;
  d.name = "refreezing";
  d.mechanism = "blocks that rest freeze together again";
  d.parameters = {
      amplitude("growth_ratio", "1", 0.5, {0.0, 50.0}, {PriorKind::kHalfNormal, 0.0, 0.5}, true,
                "strength gained at the surface in 600 s, over that of the loose ice; grows with the root of time"),
      setting("waiting_s", "s", 600.0, {0.0, 1.0e6}, "rest of the ice before time 0"),
      shape("depth_m", "m", 0.5, {0.05, 20.0}, {PriorKind::kLogNormal, 0.5, 0.5},
            "depth below the ice's top at which 1/e of that is left"),
      shape("break_strain", "1", 0.03, {1.0e-4, 1.0}, {PriorKind::kLogNormal, 0.03, 0.7},
            "plastic strain after which 1/e of what was gained is left"),
  };
  d.confusable_with = {"rate_dependence", "freeze_bonds"};
  d.how_to_tell = "two lifts after different waiting times";
  d.changes_strength = true;
  d.in_energy_balance = true;
  d.make = [](const EffectValues& values, const Scenario& scenario) {
    return std::make_unique<Refreezing>(values, scenario);
  };
  return d;
}

}  // namespace brash_ice_rig
