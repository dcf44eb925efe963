// Effects on the strength of the ice: freeze bonds, refreezing, rate of strain.

#include <cmath>

#include <gtest/gtest.h>

#include "effect_bench.h"

namespace brash_ice_rig {
namespace {

// ---- freeze_bonds

TEST(FreezeBonds, SmoothBondsKeepOneOverEAfterTheirSlip) {
  const auto bonds = makeEffect("freeze_bonds", {{"bond_cohesion_pa", 400.0}, {"slip_m", 0.01}});  // the ice has 200 Pa
  IceBench ice(3);
  // A shear angle of 0.01 m over the spacing of 0.3 m; plastic strain is that over sqrt(3).
  ice.plastic_strain[1] = static_cast<float>(0.01 / 0.3 / std::sqrt(3.0));
  ice.plastic_strain[2] = 10.0f;
  ice.step(*bonds);
  EXPECT_FLOAT_EQ(ice.changes.strength_ratio[0], 3.0f);
  EXPECT_NEAR(ice.changes.strength_ratio[1], 1.0 + 2.0 * std::exp(-1.0), 1e-6);
  EXPECT_FLOAT_EQ(ice.changes.strength_ratio[2], 1.0f);
}

TEST(FreezeBonds, BrittleBondsHoldUpToTheirSlipAndThenNotAtAll) {
  const auto bonds = makeEffect("freeze_bonds", {{"bond_cohesion_pa", 400.0}, {"slip_m", 0.01}, {"brittle", 1.0}});
  IceBench ice(2);
  ice.plastic_strain[0] = static_cast<float>(0.0099 / 0.3 / std::sqrt(3.0));
  ice.plastic_strain[1] = static_cast<float>(0.0101 / 0.3 / std::sqrt(3.0));
  ice.step(*bonds);
  EXPECT_FLOAT_EQ(ice.changes.strength_ratio[0], 3.0f);
  EXPECT_FLOAT_EQ(ice.changes.strength_ratio[1], 1.0f);
}

TEST(FreezeBonds, CohesionCountsAgainstThatOfTheShearSurfaceThatIsGiven) {
  Scenario s;
  // Table 6: alpha 200 Pa and 50 degrees are a cohesion of 200.65 Pa by eq. 10, whose alpha is 0.99674 c there.
  s.ice.cohesion_pa = 1.0;
  s.ice.shear_constant_pa = 200.0;
  IceBench ice(1);
  ice.step(*makeEffect("freeze_bonds", {{"bond_cohesion_pa", 400.0}}, s));
  EXPECT_NEAR(ice.changes.strength_ratio[0], 1.0 + 400.0 / 200.653, 1e-4);
}

// ---- refreezing

TEST(Refreezing, GainGrowsWithTheRootOfTheWaitingTimeAndFallsOffWithDepth) {
  for (const double waited : {150.0, 600.0, 2400.0}) {
    const auto frost = makeEffect(
        "refreezing", {{"growth_ratio", 0.8}, {"waiting_s", waited}, {"depth_m", 0.4}, {"break_strain", 0.03}});
    IceBench ice(2);
    ice.time_step_s = 1e-6;
    ice.site[0].z() = 0.12;  // the top of B-1's ice: 1.2 m of it with a draft of 1.08 m
    ice.site[1].z() = 0.12 - 0.4;
    ice.step(*frost);
    const double gain = 0.8 * std::sqrt(waited / 600.0);
    EXPECT_NEAR(ice.changes.strength_ratio[0], 1.0 + gain, 1e-5) << waited;
    EXPECT_NEAR(ice.changes.strength_ratio[1], 1.0 + gain * std::exp(-1.0), 1e-5) << waited;
  }
}

TEST(Refreezing, ShearTakesTheGainAwayAndRestBringsItBack) {
  const auto frost =
      makeEffect("refreezing", {{"growth_ratio", 0.8}, {"waiting_s", 600.0}, {"depth_m", 0.4}, {"break_strain", 0.03}});
  IceBench ice(1);
  ice.time_step_s = 1e-6;
  ice.site[0].z() = 0.12;
  ice.step(*frost);
  ice.plastic_strain[0] = 0.03f;
  ice.step(*frost);
  EXPECT_NEAR(ice.changes.strength_ratio[0], 1.0 + 0.8 * std::exp(-1.0), 1e-5);
  // What is left stands for exp(-2) of the rest; 150 s later it is that much longer.
  ice.time_step_s = 1.0;
  ice.run(*frost, 150.0);
  EXPECT_NEAR(ice.changes.strength_ratio[0], 1.0 + 0.8 * std::sqrt(std::exp(-2.0) + 0.25), 1e-5);
}

// ---- rate_dependence

/// Strength after 3 s of steady shearing.
double strengthAt(double rate_per_s) {
  const auto rate =
      makeEffect("rate_dependence", {{"gain_ratio", 0.5}, {"exponent", 0.25}, {"critical_rate_per_s", 0.2}});
  IceBench ice(1);
  ice.step(*rate);
  for (int k = 0; k < 1200; ++k) {
    ice.plastic_strain[0] = static_cast<float>(rate_per_s * ice.time_step_s * (k + 1));
    ice.step(*rate);
  }
  return static_cast<double>(ice.changes.strength_ratio[0]);
}

TEST(RateDependence, StrengthGrowsWithAPowerOfTheRateBelowTheCriticalOne) {
  EXPECT_EQ(strengthAt(0.0), 1.0);
  EXPECT_NEAR(strengthAt(0.2 / 16.0), 1.0 + 0.5 * 0.5, 1e-4);
  EXPECT_NEAR(strengthAt(0.1), 1.0 + 0.5 * std::pow(0.5, 0.25), 1e-4);
}

TEST(RateDependence, AddedStrengthIsViscousAboveTheCriticalRate) {
  EXPECT_NEAR(strengthAt(0.2001), 1.5, 1e-3);
  EXPECT_NEAR(strengthAt(0.4), 1.0 + 0.5 * 2.0, 1e-3);
  EXPECT_NEAR(strengthAt(0.8), 1.0 + 0.5 * 4.0, 1e-3) << "in proportion to the rate";
}

TEST(RateDependence, StrengthIsThatAtRestSoonAfterAStop) {
  const auto rate = makeEffect("rate_dependence", {{"gain_ratio", 0.5}, {"exponent", 1.0}});
  IceBench ice(1);
  ice.step(*rate);
  for (int k = 0; k < 400; ++k) {
    ice.plastic_strain[0] += 1e-3f;
    ice.step(*rate);
  }
  EXPECT_GT(ice.changes.strength_ratio[0], 1.5f);
  ice.run(*rate, 1.0);
  EXPECT_NEAR(ice.changes.strength_ratio[0], 1.0, 1e-3);
}

}  // namespace
}  // namespace brash_ice_rig
