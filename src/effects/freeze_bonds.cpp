#include <algorithm>
#include <cmath>

#include "brash_ice_rig/effects/effect.h"

#include "brash_ice_rig/ice/ice_scaling.h"
#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {
namespace {

/// Cohesion of the ice as it is without bonds, Pa: that which eq. 10 makes its alpha of.
double looseCohesion(const IceConfig& ice) {
  if (!ice.shear_constant_pa) return ice.cohesion_pa;
  return *ice.shear_constant_pa / computeShearSurface(1.0, ice.friction_angle_deg).constant_pa;
}

/// Blocks are frozen together at first. The bonds add their cohesion to that of the ice, whose whole yield surface goes
/// with it, and are lost for good as blocks slip past each other. The slip between neighbours, a spacing apart, is the
/// plastic shear strain times the spacing: s = sqrt(3) e_p dx (e_p as CapModel has it; sqrt(3) e_p is the angle of
/// simple shear). Smooth: bonds keep the share exp(-s / s_b). Brittle: all hold until s = s_b, then none.
class FreezeBonds : public Effect {
 public:
  FreezeBonds(const EffectValues& values, const Scenario& scenario)
      : strength_ratio_(values["bond_cohesion_pa"] / looseCohesion(scenario.ice)),
        slip_per_strain_(std::sqrt(3.0) * scenario.field.spacing_m / values["slip_m"]),
        brittle_(values["brittle"] != 0.0) {}

  void updateIce(const IceNow& ice, IceChanges& changes) override {
    for (std::size_t i = 0; i < ice.plastic_strain.size(); ++i) {
      const double slip = slip_per_strain_ * static_cast<double>(ice.plastic_strain[i]);
      const double bonded = brittle_ ? (slip < 1.0 ? 1.0 : 0.0) : repeatable::exp(-slip);
      changes.strength_ratio[i] += static_cast<float>(strength_ratio_ * bonded);
    }
  }

 private:
  double strength_ratio_, slip_per_strain_;
  bool brittle_;
};

}  // namespace

EffectDescription describeFreezeBonds() {
  EffectDescription d;
  d.name = "freeze_bonds";
  d.mechanism = "blocks are frozen together until they slip";
  d.parameters = {
      amplitude("bond_cohesion_pa", "Pa", 600.0, {0.0, 1.0e6}, {PriorKind::kHalfNormal, 0.0, 1000.0}, false,
                "cohesion that the bonds add to that of the ice without them"),
      shape("slip_m", "m", 0.003, {1.0e-4, 0.5}, {PriorKind::kLogNormal, 0.003, 0.7},
            "slip between neighbouring blocks over which bonds are lost"),
      switchSetting("brittle", false, "all bonds hold up to that slip and then none, instead of a gradual loss"),
  };
  d.confusable_with = {"refreezing", "rate_dependence"};
  d.how_to_tell = "a second lift at once in the same spot: broken bonds do not come back";
  d.timing_sigma_s = 1.0;
  d.changes_strength = true;
  d.in_energy_balance = true;
  d.make = [](const EffectValues& values, const Scenario& scenario) {
    return std::make_unique<FreezeBonds>(values, scenario);
  };
  return d;
}

}  // namespace brash_ice_rig
