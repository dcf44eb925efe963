// What holds for all effects alike: off is the baseline, on is not, and threads do not matter.

#include <set>
#include <string>

#include <gtest/gtest.h>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/simulation/simulation.h"
#include "effect_bench.h"

namespace brash_ice_rig {
namespace {

/// Soft ice takes long steps; what is compared here are bits, not newtons.
Scenario softLift() {
  Scenario s = smallLift();
  s.solver.stiffness_scale = 1.0e-4;
  return s;
}

std::uint64_t hashAfterLift(const Scenario& s) {
  Simulation simulation(s);
  simulation.advance(2.5);
  EXPECT_FALSE(simulation.frozen());
  return simulation.stateHash();
}

/// Amplitudes as they are by default, times within the short lift.
void enableWithinLift(Scenario& s, const std::string& name) {
  enable(s, name);
  if (name == "block_drop") s.effects[name].set("time_1_s", 1.5);
}

TEST(Effects, HaveTheNamesThatRecordsAndReportsUse) {
  const std::set<std::string> wanted = {
      "drainage",          "freeze_bonds",    "block_drop",      "vessel_heave",
      "crane_speed",       "pole_tilt",       "load_cell_bias",  "load_cell_drift",
      "load_cell_scale",   "load_cell_lag",   "refreezing",      "collector_hydrodynamics",
      "porosity_gradient", "thickness_field", "rate_dependence", "compliance"};
  std::set<std::string> names;
  for (const EffectDescription& effect : effectRegistry()) names.insert(effect.name);
  for (const std::string& name : wanted) EXPECT_EQ(names.count(name), 1u) << name;
}

TEST(Effects, OffIsTheBaselineToTheLastBitWhateverTheirParameters) {
  const Scenario plain = softLift();
  Scenario off = plain;
  for (const EffectDescription& effect : effectRegistry()) {
    for (const EffectParameter& p : effect.parameters) {
      if (p.kind == EffectParameter::Kind::kNumber) off.effects[effect.name].set(p.name, p.range.max);
    }
  }
  EXPECT_EQ(hashAfterLift(off), hashAfterLift(plain));
}

TEST(Effects, EachChangesTheWorldOrItsReading) {
  const std::uint64_t plain = hashAfterLift(softLift());
  for (const EffectDescription& effect : effectRegistry()) {
    Scenario s = softLift();
    enableWithinLift(s, effect.name);
    EXPECT_NE(hashAfterLift(s), plain) << effect.name;
  }
}

TEST(Effects, WithAllAmplitudesAtZeroLeaveTheForceAsItIs) {
  const auto forceAfterLift = [](const Scenario& s) {
    Simulation simulation(s);
    simulation.advance(1.5);
    return simulation.snapshot().force_n;
  };
  const double plain = forceAfterLift(softLift());
  for (const EffectDescription& effect : effectRegistry()) {
    Scenario s = softLift();
    enable(s, effect.name);
    bool any = false;
    for (const EffectParameter& p : effect.parameters) {
      if (p.role != ParameterRole::kAmplitude) continue;
      s.effects[effect.name].set(p.name, 0.0);
      any = true;
    }
    EXPECT_TRUE(any) << effect.name;
    EXPECT_NEAR(forceAfterLift(s), plain, 1e-4 * plain) << effect.name;
  }
}

TEST(Effects, OnTheReadingAloneLeaveTheTruthToTheLastBit) {
  const auto truthAfterLift = [](const Scenario& s) {
    Simulation simulation(s);
    simulation.advance(1.5);
    return simulation.snapshot().support_n;
  };
  const Eigen::Vector3d plain = truthAfterLift(softLift());
  std::size_t count = 0;
  for (const EffectDescription& effect : effectRegistry()) {
    if (!effect.reading_only) continue;
    ++count;
    Scenario s = softLift();
    enable(s, effect.name);
    EXPECT_EQ(truthAfterLift(s), plain) << effect.name;
  }
  EXPECT_EQ(count, 4u);
}

TEST(Effects, ThatSpareTheIceDoTheSameToTheReadingInAnyArrangementOfTheBlocks) {
  const auto reading = [](const std::string& name, std::uint64_t seed) {
    Scenario s = softLift();
    s.field.seed = seed;
    if (!name.empty()) enable(s, name);
    Simulation simulation(s);
    simulation.advance(1.0);
    return simulation.snapshot().force_n;
  };
  std::size_t count = 0;
  for (const EffectDescription& effect : effectRegistry()) {
    if (!effect.spares_ice) continue;
    ++count;
    const double change = reading(effect.name, 1) - reading("", 1);
    EXPECT_NE(change, 0.0) << effect.name;
    EXPECT_NEAR(reading(effect.name, 2) - reading("", 2), change, 1e-6 * std::abs(change)) << effect.name;
  }
  EXPECT_EQ(count, 1u);
}

TEST(Effects, AllTogetherGiveTheSameBitsForOneAndTwoThreadsAndForShortAdvances) {
  Scenario s = softLift();
  for (const EffectDescription& effect : effectRegistry()) enableWithinLift(s, effect.name);
  const std::uint64_t one = hashAfterLift(s);
  s.solver.threads = 2;
  EXPECT_EQ(hashAfterLift(s), one);
  s.solver.threads = 1;
  Simulation whole(s), pieces(s);
  whole.advance(1.0);
  for (int k = 0; k < 100; ++k) pieces.advance(0.01);
  EXPECT_EQ(pieces.stateHash(), whole.stateHash());
}

TEST(Effects, ThatCarryEnergyTheBalanceDoesNotFollowAreRefusedBesideIt) {
  std::size_t refused = 0;
  for (const EffectDescription& effect : effectRegistry()) {
    Scenario s = smallLift();
    s.output.energy = true;
    enable(s, effect.name);
    if (effect.in_energy_balance) {
      EXPECT_NO_THROW(s.validate()) << effect.name;
      continue;
    }
    ++refused;
    try {
      s.validate();
      ADD_FAILURE() << effect.name;
    } catch (const ConfigError& error) {
      EXPECT_EQ(std::string(error.what()), std::string("output.energy = true, must be false with effects.") +
                                               effect.name +
                                               ".enabled: the energy that this effect moves is not followed");
    }
  }
  EXPECT_GE(refused, 6u);
}

TEST(Effects, OfStrengthKeepTheEnergyBalanceOfTheIce) {
  Scenario s = smallLift();
  s.output.energy = true;
  const auto imbalance = [](const Scenario& scenario) {
    Simulation simulation(scenario);
    simulation.advance(3.5);
    return std::abs(simulation.snapshot().energy->imbalanceRatio());
  };
  const double plain = imbalance(s);
  for (const char* name : {"freeze_bonds", "refreezing", "rate_dependence"}) enable(s, name);
  EXPECT_LT(imbalance(s), 2.0 * plain + 1e-3);
}

TEST(EffectsOfTheLibrary, KeepTheRulesOfAnEffectOfTheUsersOwn) {
  for (const EffectDescription& effect : effectRegistry()) {
    SCOPED_TRACE(effect.name);
    EXPECT_NO_THROW(checkDescription(effect));
  }
}

TEST(EffectConfusions, NameEffectsThatThereAreAndEachOtherInReturnOrSayWhatTellsThemApart) {
  std::set<std::string> names;
  for (const EffectDescription& effect : effectRegistry()) names.insert(effect.name);
  for (const EffectDescription& effect : effectRegistry()) {
    for (const char* other : effect.confusable_with) EXPECT_EQ(names.count(other), 1u) << effect.name << ": " << other;
    EXPECT_GT(std::string(effect.how_to_tell).size(), 10u) << effect.name;
    EXPECT_GT(std::string(effect.mechanism).size(), 10u) << effect.name;
  }
}

}  // namespace
}  // namespace brash_ice_rig
