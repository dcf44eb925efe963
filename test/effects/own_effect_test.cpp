// A user's own effect, outside the library: what doc/add_an_effect.md shows. Class, description and registration are
// all that it takes; keys, ranges, files, hash and messages follow.

#include <algorithm>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/simulation/simulation.h"
#include "effect_bench.h"

namespace brash_ice_rig {
namespace {

/// A diver's line is hooked to the collector and pulls it down from a given time on.
class DiversLine : public Effect {
 public:
  DiversLine(double pull_n, double start_s) : pull_n_(pull_n), start_s_(start_s) {}

  void addRigLoads(const RigNow& rig, RigLoads& loads) override {
    if (rig.time_s >= start_s_) loads.force_n.z() -= pull_n_;
  }

 private:
  double pull_n_, start_s_;
};

EffectDescription describeDiversLine() {
  EffectDescription d;
  d.name = "divers_line";
  d.mechanism = "a diver's line pulls the collector down";
  d.parameters = {amplitude("pull_n", "N", 100.0, {0.0, 2000.0}, {PriorKind::kHalfNormal, 0.0, 100.0}, true,
                            "pull on the collector, > 0 down"),
                  shape("start_s", "s", 0.0, {0.0, 3600.0}, {PriorKind::kUniform, 0.0, 40.0}, "when it is hooked on")};
  d.confusable_with = {"load_cell_bias"};
  d.how_to_tell = "ask the diver";
  d.make = [](const EffectValues& values, const Scenario&) {
    return std::make_unique<DiversLine>(values["pull_n"], values["start_s"]);
  };
  return d;
}

const bool kRegistered = (registerEffect(describeDiversLine()), true);

std::string scenarioFile(const std::string& content) {
  const std::string path =
      ::testing::TempDir() + "own_effect_" + ::testing::UnitTest::GetInstance()->current_test_info()->name() + ".yaml";
  std::ofstream(path) << content;
  return path;
}

TEST(OwnEffect, PullsInTheSimulation) {
  ASSERT_TRUE(kRegistered);
  Scenario s = rigInTheAir();
  enable(s, "divers_line", {{"pull_n", 345.0}, {"start_s", 1.0}});
  Simulation simulation(s);
  simulation.advance(1.0);
  EXPECT_NEAR(simulation.snapshot().tension_n, 240.0 * 9.81, 1e-9);
  simulation.advance(1.0);
  EXPECT_NEAR(simulation.snapshot().tension_n, 240.0 * 9.81 + 345.0, 1e-9);
}

TEST(OwnEffect, HasItsKeysInScenarioFiles) {
  const Scenario s = loadScenario({scenarioFile("effects:\n  divers_line:\n    enabled: true\n    pull_n: 250\n"),
                                   {},
                                   {"effects.divers_line.start_s=3"}});
  Scenario read = s;
  EXPECT_TRUE(read.effects["divers_line"].enabled);
  EXPECT_EQ(read.effects["divers_line"]["pull_n"], 250.0);
  EXPECT_EQ(read.effects["divers_line"]["start_s"], 3.0);
  const Scenario again = loadScenario({scenarioFile(toYaml(s)), {}, {}});
  EXPECT_EQ(keyValues(again), keyValues(s)) << "the effective scenario repeats the run";
}

TEST(OwnEffect, IsRefusedOutOfRangeAndMisspelt) {
  const auto refusal = [](const std::string& setting) -> std::string {
    try {
      loadScenario({scenarioFile("title: x\n"), {}, {setting}});
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(refusal("effects.divers_line.pull_n=5000"),
            "--set: effects.divers_line.pull_n = 5000, must lie in [0, 2000]");
  EXPECT_EQ(refusal("effects.divers_lime.enabled=true"),
            "--set: unknown key effects.divers_lime.enabled; did you mean effects.divers_line.enabled?");
}

TEST(OwnEffect, StandsInTheRegistryAfterThoseOfTheLibrary) {
  EXPECT_EQ(std::string(effectRegistry().back().name), "divers_line");
}

TEST(OwnEffect, NeedsANameOfItsOwnAndAWayToMakeIt) {
  EXPECT_THROW(registerEffect(describeDiversLine()), std::invalid_argument);
  EffectDescription nameless = describeDiversLine();
  nameless.name = "Diver's line";
  EXPECT_THROW(registerEffect(nameless), std::invalid_argument);
  EffectDescription lifeless = describeDiversLine();
  lifeless.name = "lifeless";
  lifeless.make = nullptr;
  EXPECT_THROW(registerEffect(lifeless), std::invalid_argument);
}

/// What registerEffect() says to the diver's line after a change; what it refuses is not in the registry.
template <class Change>
std::string refusalOf(Change change) {
  EffectDescription d = describeDiversLine();
  d.name = "changed_line";
  change(d);
  try {
    registerEffect(d);
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(effectRegistry().back().name, "divers_line");
    return error.what();
  }
  return "";
}

std::string refusalOf(const EffectParameter& added) {
  return refusalOf([&](EffectDescription& d) { d.parameters.push_back(added); });
}

TEST(OwnEffect, HasOneShapeToBeTriedAndALogNormalPriorOfIt) {
  const Prior about_one{PriorKind::kLogNormal, 1.0, 0.5}, anywhere{PriorKind::kUniform, 0.0, 2.0};
  const auto tried = [](const char* name, const Prior& prior) {
    return triedShape(name, "s", 1.0, {0.0, 10.0}, prior, "a time");
  };
  EXPECT_EQ(refusalOf(tried("one_s", anywhere)), "effect changed_line: one_s is tried, its prior must be log-normal");
  EXPECT_EQ(refusalOf([&](EffectDescription& d) {
              d.parameters.insert(d.parameters.end(), {tried("one_s", about_one), tried("two_s", about_one)});
            }),
            "effect changed_line: two_s is the second shape to be tried");
}

TEST(OwnEffect, NeedsParametersWhoseDefaultAndPriorLieInTheirRange) {
  const Range range{0.0, 10.0};
  const auto with = [&](PriorKind kind, double a, double b) {
    return refusalOf(shape("one_s", "s", 1.0, range, {kind, a, b}, "a time"));
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(with(PriorKind::kUniform, 2.0, 1.0),
            "effect changed_line: prior of one_s, uniform(2, 1), does not fit its range [0, 10]");
  for (const std::string& refusal :
       {with(PriorKind::kUniform, 0.0, 11.0), with(PriorKind::kUniform, -1.0, 1.0), with(PriorKind::kNormal, 11.0, 1.0),
        with(PriorKind::kNormal, 1.0, 0.0), with(PriorKind::kNormal, nan, 1.0), with(PriorKind::kNormal, 1.0, nan),
        with(PriorKind::kLogNormal, 0.0, 1.0), with(PriorKind::kLogNormal, 11.0, 1.0),
        with(PriorKind::kLogNormal, 1.0, 0.0), with(PriorKind::kHalfNormal, 1.0, 1.0),
        with(PriorKind::kHalfNormal, 0.0, 5.1), with(PriorKind::kHalfNormal, 0.0, 0.0)}) {
    EXPECT_NE(refusal.find("does not fit its range [0, 10]"), std::string::npos) << refusal;
  }
  EXPECT_EQ(refusalOf(setting("one_s", "s", 11.0, range, "a time")),
            "effect changed_line: default of one_s must lie in [0, 10], is 11");
  EXPECT_EQ(refusalOf(shape("one_s", "s", 1.0, range, {}, "a time")), "effect changed_line: one_s needs a prior");
  EXPECT_EQ(refusalOf(amplitude("one_s", "s", 1.0, {0.1, 10.0}, {PriorKind::kNormal, 1.0, 1.0}, false, "a time")),
            "effect changed_line: one_s is an amplitude, its range must hold 0, which is off");
  EXPECT_EQ(refusalOf([](EffectDescription& d) { d.parameters.push_back(d.parameters.front()); }),
            "effect changed_line: " + std::string(describeDiversLine().parameters.front().name) + " is there twice");
}

TEST(OwnEffect, MayBeNoMoreThanTenSecondsOffInTime) {
  for (const double sigma_s : {-0.1, 10.1, std::numeric_limits<double>::quiet_NaN()}) {
    const std::string refusal = refusalOf([&](EffectDescription& d) { d.timing_sigma_s = sigma_s; });
    EXPECT_EQ(refusal.rfind("effect changed_line: timing_sigma_s must lie in [0, 10], is ", 0), 0u) << refusal;
  }
}

}  // namespace
}  // namespace brash_ice_rig
