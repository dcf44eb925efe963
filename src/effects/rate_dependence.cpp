#include <algorithm>
#include <cmath>

#include "brash_ice_rig/effects/effect.h"

#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {
namespace {

/// The rate is a mean over this time, s: long against the time step, so that the strength answers to motion and not to
/// the noise of single steps, and short against the test.
constexpr double kRateMemoryS = 0.1;

/// Ice is stronger the faster it is sheared. With the rate r of plastic strain (e_p as CapModel has it), strength is
/// multiplied by
///   1 + g (r / r_c)^n   up to the critical rate r_c, a cohesive-frictional material with a weak memory of rate,
///   1 + g r / r_c       above it: what is added is then viscous, as of a laminar fluid.
/// Greisman (1981, quoted in section 2 of the paper) sets a critical strain rate or speed between the two; a speed v at
/// the collector shears a zone of about two spacings, so that r_c is about v / (2 sqrt(3) dx).
class RateDependence : public Effect {
 public:
  explicit RateDependence(const EffectValues& values)
      : gain_(values["gain_ratio"]), exponent_(values["exponent"]), critical_(values["critical_rate_per_s"]) {}

  void updateIce(const IceNow& ice, IceChanges& changes) override {
    const std::size_t count = ice.plastic_strain.size();
    if (rate_.empty()) {
      rate_.assign(count, 0.0);
      strain_ = ice.plastic_strain;
    }
    const double share = -repeatable::expm1(-ice.time_step_s / kRateMemoryS);
    for (std::size_t i = 0; i < count; ++i) {
      const double sheared = static_cast<double>(ice.plastic_strain[i]) - static_cast<double>(strain_[i]);
      strain_[i] = ice.plastic_strain[i];
      rate_[i] += share * (std::max(sheared, 0.0) / ice.time_step_s - rate_[i]);
      const double relative = rate_[i] / critical_;
      const double growth = relative <= 1.0 ? repeatable::pow(relative, exponent_) : relative;
      changes.strength_ratio[i] *= static_cast<float>(1.0 + gain_ * growth);
    }
  }

  void visitState(StateVisitor& visitor) override {
    visitor("strain", strain_);
    visitor("rate_per_s", rate_);
  }

 private:
  double gain_, exponent_, critical_;
  std::vector<float> strain_;
  std::vector<double> rate_;  // 1/s
};

}  // namespace

EffectDescription describeRateDependence() {
  EffectDescription d;
  d.name = "rate_dependence";
  d.mechanism = "ice is stronger the faster it is sheared";
  d.parameters = {
      amplitude("gain_ratio", "1", 0.3, {0.0, 20.0}, {PriorKind::kHalfNormal, 0.0, 0.5}, true,
                "strength added at the critical rate, over that at rest"),
      shape("exponent", "1", 0.3, {0.05, 1.0}, {PriorKind::kUniform, 0.1, 1.0},
            "power of the rate below the critical one; above it the added strength is proportional to the rate"),
      shape("critical_rate_per_s", "1/s", 0.2, {1.0e-4, 100.0}, {PriorKind::kLogNormal, 0.2, 1.0},
            "rate of plastic strain at which the ice turns from cohesive to viscous"),
  };
  d.confusable_with = {"refreezing", "freeze_bonds"};
  d.how_to_tell = "lifts at two speeds, or a stop: the rate's share vanishes at once";
  d.changes_strength = true;
  d.in_energy_balance = true;
  d.make = [](const EffectValues& values, const Scenario&) { return std::make_unique<RateDependence>(values); };
  return d;
}

}  // namespace brash_ice_rig
