#include <algorithm>
#include <array>
#include <string>

#include "brash_ice_rig/effects/effect.h"

namespace brash_ice_rig {
namespace {

constexpr int kFalls = 3;
/// A particle keeps at least this share of the ice that it began with, so that what is left is still a body.
constexpr double kLeastShare = 0.1;

/// Blocks fall off the collector's edge. A block is smaller than what the continuum sees, so the ice that lies on the
/// collector loses its mass: in each fall the given mass leaves within the given time, with a rate that begins and ends
/// at 0, most of it near the rim (weight of a particle: its distance from the axis squared, times its share above the
/// water, because what is afloat does not fall). What leaves takes its momentum along: the velocity of the rest does
/// not change. Taken from is ice over the hub, within the arms' length, and raised by more than a spacing; where that
/// is not enough, the rest of the mass does not fall. What lies beyond the rim is carried by the ice around it as well.
class BlockDrop : public Effect {
 public:
  BlockDrop(const EffectValues& values, const Scenario& scenario)
      : reach_(armLength(scenario.collector)), spacing_(scenario.field.spacing_m) {
    for (int k = 0; k < kFalls; ++k) {
      const std::string number = std::to_string(k + 1);
      falls_[static_cast<std::size_t>(k)] = {values["mass_" + number + "_kg"], values["time_" + number + "_s"],
                                             values["duration_" + number + "_s"]};
    }
  }

  void updateIce(const IceNow& ice, IceChanges& changes) override {
    if (first_.empty()) first_ = changes.solid_ratio;
    double mass = 0.0;
    for (const Fall& fall : falls_) {
      const double u = (ice.time_s - fall.start) / fall.duration;
      mass += fall.mass * (computeFade(u).value - computeFade(u - ice.time_step_s / fall.duration).value);
    }
    if (!(mass > 0.0)) return;
    double weight_sum = 0.0;
    chosen_.clear();
    for (std::size_t i = 0; i < ice.position_m.size(); ++i) {
      const Eigen::Vector3d offset = ice.position_m[i] - ice.hub_position_m;
      const double plan_squared = offset.head<2>().squaredNorm();
      const bool lies = offset.z() > 0.0 && ice.position_m[i].z() - ice.site_m[i].z() > spacing_;
      if (!lies || plan_squared > reach_ * reach_) continue;
      const float dry = 1.0f - ice.water.submerged(static_cast<float>(ice.position_m[i].z()));
      const double weight = plan_squared * static_cast<double>(dry);
      if (!(weight > 0.0)) continue;
      chosen_.push_back({i, weight});
      weight_sum += weight;
    }
    if (!(weight_sum > 0.0)) return;
    for (const auto& [i, weight] : chosen_) {
      const double before = static_cast<double>(changes.solid_ratio[i]);
      const double least = kLeastShare * static_cast<double>(first_[i]);
      const double after = std::max(before - mass / ice.particle_mass_kg * weight / weight_sum, least);
      if (after >= before) continue;
      changes.solid_ratio[i] = static_cast<float>(after);
    }
  }

  void visitState(StateVisitor& visitor) override { visitor("first", first_); }

 private:
  struct Fall {
    double mass, start, duration;
  };
  std::array<Fall, kFalls> falls_{};
  double reach_, spacing_;
  std::vector<float> first_;                            // solid ratio of the undisturbed ice
  std::vector<std::pair<std::size_t, double>> chosen_;  // of this step
};

}  // namespace

EffectDescription describeBlockDrop() {
  const Range masses{0.0, 1.0e5}, times{0.0, 3600.0}, durations{0.05, 600.0};
  const Prior mass{PriorKind::kHalfNormal, 0.0, 200.0}, time{PriorKind::kUniform, 0.0, 40.0};
  const Prior duration{PriorKind::kLogNormal, 1.0, 0.7};
  EffectDescription d;
  d.name = "block_drop";
  d.mechanism = "blocks fall off the edge of the collector";
  d.parameters = {
      amplitude("mass_1_kg", "kg", 100.0, masses, mass, true, "ice that falls first"),
      shape("time_1_s", "s", 15.0, times, time, "when that fall begins"),
      shape("duration_1_s", "s", 1.0, durations, duration, "how long it takes"),
      amplitude("mass_2_kg", "kg", 0.0, masses, mass, true, "ice that falls in a second fall"),
      shape("time_2_s", "s", 18.0, times, time, "when that fall begins"),
      shape("duration_2_s", "s", 1.0, durations, duration, "how long it takes"),
      amplitude("mass_3_kg", "kg", 0.0, masses, mass, true, "ice that falls in a third fall"),
      shape("time_3_s", "s", 30.0, times, time, "when that fall begins"),
      shape("duration_3_s", "s", 1.0, durations, duration, "how long it takes"),
  };
  d.confusable_with = {"drainage"};
  d.how_to_tell = "a camera; a hold after the lift";
  d.changes_mass = true;
  d.make = [](const EffectValues& values, const Scenario& scenario) {
    return std::make_unique<BlockDrop>(values, scenario);
  };
  return d;
}

}  // namespace brash_ice_rig
