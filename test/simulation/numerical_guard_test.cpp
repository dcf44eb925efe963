#include "brash_ice_rig/simulation/numerical_guard.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "../config/key_lister.h"
#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/simulation/simulation.h"

namespace brash_ice_rig {
namespace {

TEST(NumericalGuardBounds, FastestIsAFallFromTheCranesHeightThrownAndDoubled) {
  Scenario s;
  s.crane.max_height_m = 8.8;  // and 1.2 m of ice: sqrt(2 g 10 m) = 14.007 m/s
  s.crane.max_speed_mps = 0.5;
  EXPECT_NEAR(NumericalGuard::computeFastest(s), 2.0 * (14.00714 + 0.866025) + 10.0, 1e-4);
  s.crane.max_height_m = -3.0;  // below the water: the ice itself still stands above it
  EXPECT_NEAR(NumericalGuard::computeFastest(s), 2.0 * (4.852216 + 0.866025) + 10.0, 1e-4);
}

TEST(NumericalGuardBounds, EnergyIsThatOfASpreadingLayerAndTheSizesOfAllWork) {
  Scenario s;  // 1.2 m of 900 kg/m³ in 1000 kg/m³: 0.06 m, and a spacing of 0.3 m
  NumericalGuard guard(s, 1000.0);
  EXPECT_NEAR(guard.energyBound(), 1000.0 * 9.81 * 0.36, 1e-9);
  guard.addWork(250.0);
  guard.addWork(-150.0);
  EXPECT_NEAR(guard.energyBound(), 1000.0 * 9.81 * 0.36 + 400.0, 1e-9);
}

// ------------------------------------------------------------------------------------------- what the status says

/// 200 particles and a collector in the ice.
const std::vector<std::string>& smallField() {
  static const std::vector<std::string> settings = {"field.length_x_m=3",           "field.length_y_m=3",
                                                    "field.thickness_m=0.6",        "collector.radius_m=0.7",
                                                    "collector.pole_radius_m=0.05", "solver.threads=1",
                                                    "solver.active_set=false",      "procedure.settle_duration_s=0.2"};
  return settings;
}

Scenario scenarioOf(std::vector<std::string> changes) {
  std::vector<std::string> settings = smallField();
  settings.insert(settings.end(), changes.begin(), changes.end());
  return loadScenario({"", {}, settings});
}

/// Runs until the guard trips. @return what it says
std::string breakdownOf(const std::vector<std::string>& changes) {
  Simulation simulation(scenarioOf(changes));
  for (int sample = 0; sample < 1500 && !simulation.frozen(); ++sample) {
    EXPECT_EQ(simulation.breakdown(), "");
    simulation.advance(simulation.samplePeriod());
  }
  EXPECT_TRUE(simulation.frozen());
  return simulation.breakdown();
}

bool says(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(NumericalGuard, NamesParticlePlaceTimeAndTheKeyOfAContactThatIsTooStiff) {
  const std::string text =
      breakdownOf({"contact.min_stiffness_npm=1e12", "procedure.lift_speed_mps=0.3", "procedure.lift_duration_s=4"});
  unsigned long particle = 0;
  double x = 0.0, y = 0.0, z = 0.0, t = -1.0;
  ASSERT_EQ(std::sscanf(text.c_str(), "particle %lu at (%lf, %lf, %lf) m, t = %lf s", &particle, &x, &y, &z, &t), 5)
      << text;
  EXPECT_LT(particle, 200u);
  EXPECT_LT(std::hypot(x, y), 1.0) << "on the collector: " << text;
  EXPECT_LT(std::abs(z), 2.0) << text;
  EXPECT_TRUE(says(text, "contact.min_stiffness_npm")) << text;
}

TEST(NumericalGuard, HasNothingToStopWhereAViscosityIsMoreThanAStepCanBear) {
  Simulation simulation(
      scenarioOf({"solver.cfl_ratio=0.9", "solver.viscosity_ratio=1", "solver.viscosity_speed_mps=5000",
                  "solver.determinant_limit=0", "solver.volume_ratio_limit=10"}));
  simulation.advance(15.0);
  EXPECT_FALSE(simulation.frozen()) << simulation.breakdown();
}

TEST(NumericalGuard, IsAsStrictAfterACheckpoint) {
  Simulation simulation(scenarioOf({"procedure.lift_speed_mps=0.3", "procedure.lift_duration_s=4"}));
  simulation.advance(2.0);
  const std::string path = testing::TempDir() + "brash_ice_guard.bin";
  simulation.save(path);
  Simulation loaded = Simulation::load(path);
  std::remove(path.c_str());
  simulation.advance(1.0);
  loaded.advance(1.0);
  EXPECT_FALSE(loaded.frozen()) << loaded.breakdown();
  EXPECT_EQ(loaded.stateHash(), simulation.stateHash());
}

// --------------------------------------------------------------------------------------------- extreme but legal

/// What became of many scenarios.
struct Tally {
  int legal = 0, refused = 0, tripped = 0;
  std::map<std::string, int> causes;  ///< of those that were stopped
};

bool allFinite(const std::vector<float>& values) {
  for (const float value : values) {
    if (!std::isfinite(value)) return false;
  }
  return true;
}

/// Empty, or which published value is not finite.
std::string notFinite(const Simulation& simulation) {
  const Snapshot s = simulation.snapshot();
  const ForceBalance& c = s.components;
  for (const double value :
       {s.time_s, s.force_n, s.tension_n, s.kinetic_energy_j, c.weight_n, c.buoyancy_n, c.ice_normal_n,
        c.ice_friction_n, c.inertia_n, c.plug_gravity_n, c.plug_buoyancy_n, c.plug_drag_n, c.plug_friction_n,
        s.rig.hoist_position_m, s.rig.fold_ratio, s.rig.arm_angle_rad, s.rig.crane_hub_height_m}) {
    if (!std::isfinite(value)) return "snapshot";
  }
  for (const Eigen::Vector3d& vector : {s.support_n, s.load_cell_force_n, s.ice_force_n, s.rig.crane_position_m,
                                        s.rig.crane_velocity_mps, s.rig.commanded_velocity_mps}) {
    if (!vector.allFinite()) return "a vector of the snapshot";
  }
  const ParticleCloud cloud = simulation.particles();
  if (!allFinite(cloud.x_m) || !allFinite(cloud.y_m) || !allFinite(cloud.z_m)) return "a position";
  if (!allFinite(cloud.speed_mps)) return "a speed";
  if (!allFinite(cloud.pressure_pa)) return "a pressure";
  if (!allFinite(cloud.plastic_strain) || !allFinite(cloud.damage)) return "a state";
  if (!allFinite(cloud.submerged)) return "a submerged share";
  const PlugSummary plug = simulation.plug();
  for (const double value : {plug.lifted_mass_kg, plug.radius_at_waterline_m, plug.radius_at_top_m,
                             plug.hole_refill_ratio, plug.hole_cover_ratio, plug.bulge_height_m, plug.bulge_radius_m}) {
    if (!std::isfinite(value)) return "plug";
  }
  return "";
}

std::string joined(const std::vector<std::string>& settings) {
  std::string text;
  for (const std::string& setting : settings) text += setting + " ";
  return text;
}

/// Runs a scenario for a few hundred steps, if it is legal and small.
void tryScenario(const std::vector<std::string>& changes, Tally& tally) {
  std::optional<Scenario> scenario;
  try {
    scenario = scenarioOf(changes);
    if (particleCount(scenario->field) > 4000.0) return;
    Simulation simulation(*scenario);
    ++tally.legal;
    const int chunks = scenario->solver.threads > 4 ? 1 : 12;
    for (int chunk = 0; chunk < chunks && !simulation.frozen(); ++chunk) {
      simulation.advance(25.0 * simulation.timeStep());
      ASSERT_EQ(notFinite(simulation), "") << joined(changes);
    }
    if (!simulation.frozen()) return;
    ++tally.tripped;
    const std::string& why = simulation.breakdown();
    const std::size_t cause = why.find(" is from ");
    ++tally
          .causes[cause == std::string::npos ? "force on the rig" : why.substr(cause + 9, why.rfind(": ") - cause - 9)];
    EXPECT_TRUE(simulation.advance(simulation.timeStep()).flags.has(StatusFlag::kNonFinite)) << joined(changes);
    EXPECT_TRUE(says(simulation.breakdown(), "lower ")) << joined(changes) << simulation.breakdown();
  } catch (const ConfigError& error) {
    ++tally.refused;
    EXPECT_FALSE(error.rule().empty()) << joined(changes);
  }
}

std::string setting(const KeyLister::Number& number, double value) {
  char text[64];
  std::snprintf(text, sizeof text, number.whole ? "%.0f" : "%.17g", value);
  return number.key + "=" + text;
}

/// A setting of an effect counts only while the effect is on.
void addWithEffect(std::vector<std::string>& changes, const std::string& key, const std::string& change) {
  constexpr char kEffects[] = "effects.";
  if (key.rfind(kEffects, 0) == 0) changes.push_back(key.substr(0, key.rfind('.')) + ".enabled=true");
  changes.push_back(change);
}

double lowest(const Range& range, bool whole) {
  return !range.min_open ? range.min : whole ? range.min + 1.0 : std::nextafter(range.min, range.max);
}
double highest(const Range& range, bool whole) {
  return !range.max_open ? range.max : whole ? range.max - 1.0 : std::nextafter(range.max, range.min);
}

void tell(const char* what, const Tally& tally) {
  std::printf("%s: %d legal, of which %d stopped by the guard with its reason", what, tally.legal, tally.tripped);
  for (const auto& [cause, count] : tally.causes) std::printf(", %d %s", count, cause.c_str());
  std::printf("; %d refused\n", tally.refused);
}

TEST(ExtremeScenarios, CornersOfEachRangeGiveNoNanAndNoCrash) {
  Tally tally;
  for (const KeyLister::Number& number : KeyLister(Scenario()).numbers) {
    for (const double corner : {lowest(number.range, number.whole), highest(number.range, number.whole)}) {
      std::vector<std::string> changes;
      addWithEffect(changes, number.key, setting(number, corner));
      tryScenario(changes, tally);
      if (HasFatalFailure()) return;
    }
  }
  tell("corners", tally);
  EXPECT_GT(tally.legal, 100);
}

/// One in six keys gets another value: a corner, or somewhere between, evenly or by orders of magnitude.
std::vector<std::string> randomChanges(std::mt19937& random, const KeyLister& keys) {
  std::vector<std::string> changes;
  const auto uniform = [&random] { return std::uniform_real_distribution<double>(0.0, 1.0)(random); };
  for (const KeyLister::Number& number : keys.numbers) {
    // The field stays small; its spacing and lengths have their turn among the corners.
    const bool size = number.key.rfind("field.", 0) == 0 && number.key.find("_m") != std::string::npos;
    if (size || number.key == "solver.threads" || uniform() > 1.0 / 6.0) continue;
    const double low = lowest(number.range, number.whole), high = highest(number.range, number.whole);
    const double kind = uniform(), share = uniform();
    double value = low + share * (high - low);
    if (kind < 0.2) {
      value = share < 0.5 ? low : high;
    } else if (kind < 0.6 && high > 0.0) {
      const double from = std::max(low, 1.0e-6 * high);
      value = from * std::pow(high / from, share);
    }
    if (number.whole) value = std::round(value);
    addWithEffect(changes, number.key, setting(number, value));
  }
  for (const auto& [key, words] : keys.words) {
    if (uniform() > 0.3 || key == "procedure.control") continue;
    const std::size_t comma = words.find(", ");
    changes.push_back(key + "=" + (uniform() < 0.5 ? words.substr(0, comma) : words.substr(words.rfind(", ") + 2)));
  }
  for (const std::string& key : keys.switches) {
    if (key.rfind("effects.", 0) != 0 && uniform() < 0.3)
      changes.push_back(key + (uniform() < 0.5 ? "=true" : "=false"));
  }
  return changes;
}

TEST(ExtremeScenarios, RandomLegalOnesGiveNoNanAndNoCrash) {
  // The fault campaign asks for more, with other seeds.
  const auto number = [](const char* name, int otherwise) {
    const char* text = std::getenv(name);
    return text == nullptr ? otherwise : std::atoi(text);
  };
  const int wanted = number("BRASH_ICE_RANDOM_SCENARIOS", 40);
  std::mt19937 random(static_cast<unsigned>(number("BRASH_ICE_RANDOM_SEED", 1)));
  const KeyLister keys{Scenario()};
  Tally tally;
  for (int attempt = 0; attempt < 100 * wanted && tally.legal < wanted; ++attempt) {
    tryScenario(randomChanges(random, keys), tally);
    if (HasFatalFailure()) return;
  }
  tell("random scenarios", tally);
  EXPECT_EQ(tally.legal, wanted);
}

}  // namespace
}  // namespace brash_ice_rig
