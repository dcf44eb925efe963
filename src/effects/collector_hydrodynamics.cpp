#include <algorithm>
#include <cmath>

#include "brash_ice_rig/effects/effect.h"
#include "brash_ice_rig/math/angle.h"
#include "brash_ice_rig/math/repeatable.h"
#include "brash_ice_rig/rig/collector.h"

namespace brash_ice_rig {
namespace {

/// Water resists the collector: F = -1/2 rho C_d A v |v| and an added mass C_a rho V, vertical, in still water.
///
/// A is what the arms and the threads of the net cover in plan. V is that of the cylinders, as long as arms and
/// threads are and as wide: pi / 4 w A_arms + pi / 4 d A_net; C_a = 1 is the potential-flow value of a cylinder across
/// the flow. Both count with the share of the collector's height that is under water.
/// Source: Morison et al. (1950); C_a of a cylinder: Lamb (1932), section 68.
class CollectorHydrodynamics : public Effect {
 public:
  CollectorHydrodynamics(const EffectValues& values, const Scenario& scenario)
      : drag_coefficient_(values["drag_coefficient"]),
        added_mass_coefficient_(values["added_mass_coefficient"]),
        solidity_(values["net_solidity_ratio"]),
        thread_(values["thread_diameter_m"]),
        arm_width_(values["arm_width_m"]),
        density_(scenario.water.density_kgpm3),
        arm_length_(armLength(scenario.collector)) {}

  void addRigLoads(const RigNow& rig, RigLoads& loads) override {
    const double reach = arm_length_ * repeatable::cos(rig.arm_angle_rad);
    const double rise = arm_length_ * repeatable::sin(rig.arm_angle_rad);
    const double octagon = 0.5 * kArmCount * repeatable::sin(2.0 * kPi / kArmCount) * reach * reach;
    const double net = solidity_ * octagon, arms = kArmCount * arm_width_ * reach;
    const double lowest = rig.hub_position_m.z() + std::min(rise, 0.0);
    const double submerged = std::clamp(-lowest / std::max(std::abs(rise), 1.0e-3), 0.0, 1.0);
    const double speed = rig.hub_velocity_mps.z();
    loads.force_n.z() -= 0.5 * density_ * drag_coefficient_ * submerged * (net + arms) * speed * std::abs(speed);
    loads.added_mass_kg +=
        added_mass_coefficient_ * density_ * submerged * 0.25 * kPi * (thread_ * net + arm_width_ * arms);
  }

 private:
  double drag_coefficient_, added_mass_coefficient_, solidity_, thread_, arm_width_, density_, arm_length_;
};

}  // namespace

EffectDescription describeCollectorHydrodynamics() {
  EffectDescription d;
  d.name = "collector_hydrodynamics";
  d.mechanism = "water drags on net and arms and has to be accelerated along";
  d.parameters = {
      amplitude("drag_coefficient", "1", 1.2, {0.0, 20.0}, {PriorKind::kLogNormal, 1.2, 0.3}, true,
                "C_d of net and arms; 1.2 is a cylinder"),
      amplitude("added_mass_coefficient", "1", 1.0, {0.0, 20.0}, {PriorKind::kLogNormal, 1.0, 0.3}, true,
                "C_a of threads and arms; 1 is a cylinder"),
      setting("net_solidity_ratio", "1", 0.2, {0.0, 1.0}, "share of the net's area that is thread"),
      setting("thread_diameter_m", "m", 0.003, {1.0e-4, 0.1}, "thickness of the net's threads"),
      setting("arm_width_m", "m", 0.08, {0.0, 1.0}, "width of an arm"),
  };
  d.confusable_with = {"load_cell_bias"};
  d.how_to_tell = "lifts in open water at several speeds; at 0.05 m/s it is a few newtons and cannot be seen";
  d.spares_ice = true;
  d.make = [](const EffectValues& values, const Scenario& scenario) {
    return std::make_unique<CollectorHydrodynamics>(values, scenario);
  };
  return d;
}

}  // namespace brash_ice_rig
