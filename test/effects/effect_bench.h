#pragma once

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "brash_ice_rig/effects/effect.h"

namespace brash_ice_rig {

using EffectKeys = std::initializer_list<std::pair<const char*, double>>;

inline void enable(Scenario& scenario, const std::string& name, EffectKeys keys = {}) {
  EffectValues& values = scenario.effects[name];
  values.enabled = true;
  for (const auto& [key, value] : keys) values.set(key, value);
}

/// One effect alone, made as the simulation makes it.
inline std::unique_ptr<Effect> makeEffect(const std::string& name, EffectKeys keys, Scenario scenario = {}) {
  enable(scenario, name, keys);
  scenario.validate();
  const EffectValues& values = scenario.effects[name];
  return values.description().make(values, scenario);
}

/// A field of 3.6 x 3.6 m and a collector of 0.7 m that lifts fast: 576 particles, a fifth of a second of computing.
inline Scenario smallLift() {
  Scenario s;
  s.field.length_x_m = 3.6;
  s.field.length_y_m = 3.6;
  s.collector.radius_m = 0.7;
  s.collector.rim_height_m = 0.2;
  s.procedure.settle_duration_s = 0.5;
  s.procedure.lift_speed_mps = 0.3;
  s.procedure.lift_duration_s = 3.0;
  s.solver.threads = 1;
  return s;
}

/// The rig alone: folded, 2 m over the ice, driven by hand.
inline Scenario rigInTheAir() {
  Scenario s = smallLift();
  s.procedure.control = ControlMode::kManual;
  s.procedure.start = StartPose::kFoldedAboveIce;
  s.procedure.start_gap_m = 2.0;
  return s;
}

/// A few particles that a test moves and shears by hand, in place of the simulation.
struct IceBench {
  explicit IceBench(std::size_t count, const Scenario& s = {})
      : site(count, Eigen::Vector3d(0.0, 0.0, -1.0)),
        position(site),
        plastic_strain(count, 0.0f),
        pore_volume(count, static_cast<float>(s.ice.void_fraction * 0.027)),
        water(s.water, s.ice, s.field.spacing_m) {
    changes.strength_ratio.assign(count, 1.0f);
    changes.solid_ratio.assign(count, 1.0f);
    changes.held_water_kg.assign(count, 0.0f);
  }

  /// One step as the simulation takes it.
  void step(Effect& effect) {
    time_s += time_step_s;
    std::fill(changes.strength_ratio.begin(), changes.strength_ratio.end(), 1.0f);
    effect.updateIce({time_s, time_step_s, site, position, plastic_strain, pore_volume, 9.72, water, hub}, changes);
  }
  void run(Effect& effect, double duration_s) {
    for (auto steps = static_cast<int>(duration_s / time_step_s + 0.5); steps > 0; --steps) step(effect);
  }

  double time_s = 0.0, time_step_s = 0.0025;
  std::vector<Eigen::Vector3d> site, position;
  std::vector<float> plastic_strain, pore_volume;
  ParticleInWater water;
  Eigen::Vector3d hub = Eigen::Vector3d(0.0, 0.0, -1.38);
  IceChanges changes;
};

}  // namespace brash_ice_rig
