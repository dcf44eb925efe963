#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <string>
#include <vector>

#include "brash_ice_rig/identify/record.h"

namespace brash_ice_rig {

/// How a record for tests is to be made.
struct RecordRecipe {
  double rate_hz = 50.0;
  double quiet_s = 20.0;
  /// Lifting and resting, s, by turns.
  std::vector<double> stages_s = {40.0, 6.0};
  double lift_speed_mps = 0.052;
  double peak_n = 15000.0;
  double white_noise_n = 40.0;
  double slow_noise_n = 60.0;  ///< correlated over 1 s
  double mass_kg = 1500.0;     ///< of what hangs on the hoist and must be accelerated
  double resolution_n = 10.0;
  double force_delay_s = 0.0;  ///< the force's clock is late by this
  double tare_n = 0.0;
  unsigned seed = 1;
};

/// A pull-up record after the shape of the paper's: a steep start, a peak, a lower level, and ice that relaxes by some
/// per cent when the hoist stops. Its formulas are this file's own, not the simulator's.
inline Record makeRecord(const RecordRecipe& recipe = {}) {
  std::mt19937_64 generator(recipe.seed);
  std::normal_distribution<double> normal;
  const double dt = 1.0 / recipe.rate_hz;
  double total_s = recipe.quiet_s;
  for (const double stage_s : recipe.stages_s) total_s += stage_s;

  // Motion with ramps of 0.2 s, ten times finer than the samples so that the delay need not be a multiple of dt.
  const double fine_s = 0.1 * dt;
  const auto wantedSpeed = [&](double time_s) {
    double start_s = recipe.quiet_s;
    for (std::size_t k = 0; k < recipe.stages_s.size(); ++k) {
      if (time_s >= start_s && time_s < start_s + recipe.stages_s[k]) return k % 2 == 0 ? recipe.lift_speed_mps : 0.0;
      start_s += recipe.stages_s[k];
    }
    return 0.0;
  };
  std::vector<double> way_m, speed_mps, ice_n;
  double way = 0.0, speed = 0.0, relaxed = 0.0;
  for (double time_s = 0.0; time_s < total_s; time_s += fine_s) {
    const double change = std::clamp(wantedSpeed(time_s) - speed, -0.26 * fine_s, 0.26 * fine_s);
    speed += change;
    way += speed * fine_s;
    const double s = way / 1.2;
    const double level = s < 1.0 ? 1.0 - std::pow(1.0 - s, 2.2) : 0.72 + 0.28 * std::exp(-3.0 * (s - 1.0));
    relaxed += fine_s * ((speed == 0.0 ? 0.04 : 0.0) - relaxed) / 4.0;
    way_m.push_back(way);
    speed_mps.push_back(speed);
    ice_n.push_back(recipe.peak_n * level * (1.0 - relaxed) + recipe.mass_kg * change / fine_s);
  }

  Record record;
  record.title = "made";
  record.source = RecordSource::kSynthetic;
  record.tare_n = recipe.tare_n;
  record.position_given = true;
  double slow = 0.0;
  const double keep = std::exp(-dt);
  for (std::size_t i = 0; i < way_m.size(); i += 10) {
    const double time_s = static_cast<double>(i) * fine_s;
    const auto delayed = static_cast<std::ptrdiff_t>(std::lround((time_s - recipe.force_delay_s) / fine_s));
    const std::size_t at =
        static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(delayed, 0, static_cast<std::ptrdiff_t>(ice_n.size()) - 1));
    slow = keep * slow + std::sqrt(1.0 - keep * keep) * recipe.slow_noise_n * normal(generator);
    double force_n = recipe.tare_n + ice_n[at] + slow + recipe.white_noise_n * normal(generator);
    if (recipe.resolution_n > 0.0) force_n -= std::remainder(force_n, recipe.resolution_n);
    record.line.push_back(record.line.size() + 2);
    record.time_s.push_back(time_s);
    record.force_n.push_back(force_n);
    record.hoist_position_m.push_back(-1.38 + way_m[i]);
    record.hoist_speed_mps.push_back(speed_mps[i]);
  }
  return record;
}

}  // namespace brash_ice_rig
