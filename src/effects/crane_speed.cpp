#include <algorithm>
#include <cmath>

#include "brash_ice_rig/effects/effect.h"

namespace brash_ice_rig {
namespace {

/// A winch slips under load: v = v_0 - |v_0| a T / T_ref for a tension T > 0. Hoisting it is slower, lowering faster.
class CraneSpeed : public Effect {
 public:
  CraneSpeed(double loss_ratio, double reference_load_n) : loss_per_n_(loss_ratio / reference_load_n) {}

  void updateCraneVelocity(const RigNow& rig, Eigen::Vector3d& wanted_mps) override {
    const double loss = std::min(loss_per_n_ * std::max(rig.tension_n, 0.0), 1.0);
    wanted_mps.z() -= loss * std::abs(wanted_mps.z());
  }

 private:
  double loss_per_n_;
};

}  // namespace

EffectDescription describeCraneSpeed() {
  EffectDescription d;
  d.name = "crane_speed";
  d.mechanism = "the hoist loses speed under load";
  d.parameters = {
      amplitude("loss_ratio", "1", 0.05, {0.0, 1.0}, {PriorKind::kHalfNormal, 0.0, 0.1}, true,
                "share of the speed that is lost at the reference load; grows with the load up to a standstill"),
      setting("reference_load_n", "N", 12000.0, {100.0, 1.0e7}, "tension at which that share is lost"),
  };
  d.confusable_with = {"compliance", "load_cell_lag"};
  d.how_to_tell = "a measured position, which is then replayed; or a cycle of lifting and lowering";
  d.in_energy_balance = true;
  d.make = [](const EffectValues& values, const Scenario&) {
    return std::make_unique<CraneSpeed>(values["loss_ratio"], values["reference_load_n"]);
  };
  return d;
}

}  // namespace brash_ice_rig
