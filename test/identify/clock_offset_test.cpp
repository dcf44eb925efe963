#include "brash_ice_rig/identify/clock_offset.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

/// A lift without a stop but one, and what it does to the force, free of noise: 10 s up, 10 s at rest.
struct Made {
  std::vector<double> time_s, force_n, position_m, speed_mps;

  Made(double delay_s, double slope_npm, double drag_ns_per_m, double mass_kg) {
    constexpr double kSpeedMps = 0.05;
    constexpr double kRampS = 0.2;
    const auto left_s = [&](double t) { return std::clamp(t - 10.0, 0.0, kRampS); };
    const auto speed = [&](double t) { return kSpeedMps * (1.0 - left_s(t) / kRampS); };
    const auto way = [&](double t) {
      return kSpeedMps * (std::min(t, 10.0) + left_s(t) - 0.5 * left_s(t) * left_s(t) / kRampS);
    };
    const auto acceleration = [&](double t) { return t > 10.0 && t < 10.0 + kRampS ? -kSpeedMps / kRampS : 0.0; };
    for (int i = 0; i <= 1000; ++i) {
      const double t = 0.02 * i;
      time_s.push_back(t);
      position_m.push_back(way(t));
      speed_mps.push_back(speed(t));
      const double then = t - delay_s;
      force_n.push_back(100.0 + slope_npm * way(then) + drag_ns_per_m * speed(then) + mass_kg * acceleration(then));
    }
  }

  ClockOffset offset() const { return computeClockOffset(time_s, force_n, position_m, speed_mps, {{8.0, 12.0}}); }
};

TEST(ClockOffset, SlopeDragAndMassEachTellIt) {
  for (const double delay_s : {-0.7, 0.0, 0.35, 1.2}) {
    EXPECT_NEAR(Made(delay_s, 10000.0, 0.0, 0.0).offset().offset_s, delay_s, 0.03) << "slope";
    EXPECT_NEAR(Made(delay_s, 0.0, 5000.0, 0.0).offset().offset_s, delay_s, 0.03) << "drag";
    EXPECT_NEAR(Made(delay_s, 0.0, 0.0, 2000.0).offset().offset_s, delay_s, 0.03) << "mass";
    EXPECT_LT(Made(delay_s, 10000.0, 5000.0, 2000.0).offset().sigma_s, 0.06);
  }
}

TEST(ClockOffset, ForceThatDoesNotReactTellsNothing) {
  // Even odds within ±1.5 s: a standard deviation of 1.5 s / sqrt(3).
  const ClockOffset clock = Made(0.5, 0.0, 0.0, 0.0).offset();
  EXPECT_NEAR(clock.offset_s, 0.0, 0.05);
  EXPECT_NEAR(clock.sigma_s, kMaxClockOffsetS / std::sqrt(3.0), 0.03);
}

TEST(ClockOffset, WindowsThatContradictEachOtherWidenTheUncertainty) {
  // Two stops, one second apart in their delays: free of noise, each is sure of itself.
  Made made(-0.5, 10000.0, 0.0, 2000.0);
  const Made late(0.5, 10000.0, 0.0, 2000.0);
  const std::size_t size = made.time_s.size();
  for (std::size_t i = 0; i < size; ++i) {
    made.time_s.push_back(20.02 + late.time_s[i]);
    made.force_n.push_back(late.force_n[i]);
    made.position_m.push_back(late.position_m[i]);
    made.speed_mps.push_back(late.speed_mps[i]);
  }
  const ClockOffset clock =
      computeClockOffset(made.time_s, made.force_n, made.position_m, made.speed_mps, {{8.0, 12.0}, {28.02, 32.02}});
  EXPECT_GT(clock.sigma_s, 0.4);
}

TEST(ClockOffset, StaysFiniteWhateverTheNumbers) {
  Made made(0.0, 10000.0, 0.0, 0.0);
  for (std::size_t i = 0; i < made.force_n.size(); i += 2) {
    made.force_n[i] = std::numeric_limits<double>::max();
    made.position_m[i] = -std::numeric_limits<double>::max();
  }
  EXPECT_TRUE(std::isfinite(made.offset().offset_s));
  EXPECT_GT(made.offset().sigma_s, 0.5);
}

}  // namespace
}  // namespace brash_ice_rig
