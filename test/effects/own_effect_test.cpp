// A user's own effect, outside the library: what doc/add_an_effect.md shows. Class, description and registration are
// all that it takes; keys, ranges, files, hash and messages follow.

#include <algorithm>
#include <fstream>
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

TEST(OwnEffect, HasOneShapeToBeTriedAndALogNormalPriorOfIt) {
  const auto refusal = [](const EffectParameter& first, const EffectParameter& second) -> std::string {
    EffectDescription d = describeDiversLine();
    d.name = "tried_line";
    d.parameters.push_back(first);
    d.parameters.push_back(second);
    try {
      registerEffect(d);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  const Prior about_one{PriorKind::kLogNormal, 1.0, 0.5}, anywhere{PriorKind::kUniform, 0.0, 2.0};
  const auto tried = [](const char* name, const Prior& prior) {
    return triedShape(name, "s", 1.0, {0.1, 10.0}, prior, "a time");
  };
  EXPECT_EQ(refusal(tried("one_s", anywhere), shape("two_s", "s", 1.0, {0.1, 10.0}, about_one, "a time")),
            "effect tried_line: one_s is tried, its prior must be log-normal");
  EXPECT_EQ(refusal(tried("one_s", about_one), tried("two_s", about_one)),
            "effect tried_line: two_s is the second shape to be tried");
  EXPECT_EQ(std::string(effectRegistry().back().name), "divers_line") << "what is refused is not in the registry";
}

}  // namespace
}  // namespace brash_ice_rig
