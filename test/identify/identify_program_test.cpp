// Drives `brash_ice identify` as a test engineer does, on records of a small field that our own simulator makes.

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <random>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "../output/shell.h"
#include "../output/temporary_directory.h"
#include "brash_ice_rig/identify/observation.h"

namespace brash_ice_rig {
namespace {

class IdentifyProgram : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    directory_ = new TemporaryDirectory();
    directory_->put("small.yaml",
                    "title: Small field\n"
                    "field: {length_x_m: 3.6, length_y_m: 3.6, thickness_m: 0.6, jitter_ratio: 0.1, seed: 99}\n"
                    "collector: {radius_m: 0.9, rim_height_m: 0.2, displaced_volume_m3: 0.001, pole_radius_m: 0.02}\n"
                    "procedure: {settle_duration_s: 2.0, lift_speed_mps: 0.15, lift_duration_s: 8.0, "
                    "hold_duration_s: 5.0}\n"
                    "solver: {threads: 1, active_set: false}\n");
    const Outcome run = program("run small.yaml --out run");
    ASSERT_EQ(run.exit_code, 0) << run.text;
  }
  static void TearDownTestSuite() {
    delete directory_;
    directory_ = nullptr;
  }

  static Outcome program(const std::string& arguments) {
    return runShell("cd '" + directory_->path() + "' && '" BRASH_ICE_PROGRAM "' " + arguments);
  }

  /// Makes a record of a run: 8 s of rest, then the lift, with noise and what `changed` does to the force.
  static void record(const std::string& name, unsigned seed,
                     const std::function<double(double force_n, double empty_force_n)>& changed,
                     const std::string& run = "run", bool lateral = false, double speed_mps = 0.15,
                     double simulated_rest_s = 0.0, const std::string& rig = "run", double noise_n = 15.0) {
    const SimulatedForce force = readSimulatedForce(directory_->file(run), simulated_rest_s);
    std::mt19937 generator(seed);
    std::normal_distribution<double> noise(0.0, noise_n);
    std::ofstream csv(directory_->file(name + ".csv"));
    csv << "time_s,force_n,hoist_position_m" << (lateral ? ",force_x_n,force_y_n" : "") << '\n';
    const double start_m = -0.74;
    for (int row = 0; row * 0.02 < 21.0; ++row) {
      const double time = row * 0.02 - 8.0, lifted = std::min(std::max(time, 0.0) * speed_mps, 1.2);
      const auto at = static_cast<std::size_t>(std::max(std::lround((time + simulated_rest_s) / 0.01), 0L));
      const std::size_t i = std::min(at, force.force_n.size() - 1);
      csv << row * 0.02 << ',' << std::round(changed(force.force_n[i], force.empty_force_n[i]) + noise(generator))
          << ',' << start_m + lifted;
      if (lateral) csv << ',' << force.force_x_n[i] + noise(generator) << ',' << force.force_y_n[i] + noise(generator);
      csv << '\n';
    }
    std::ofstream(directory_->file(name + ".yaml"))
        << "source: synthetic\ntare_n: 0\nposition: measured\nrig: " << rig
        << "/scenario.yaml\n"
           "ice: {thickness_m: 0.6, void_fraction: 0.6 ± 0.03, cohesion_pa: 200 ± 50, friction_angle_deg: 50 ± 3}\n";
  }

  static nlohmann::json report(const std::string& directory) {
    return nlohmann::json::parse(std::ifstream(directory_->file(directory + "/report.json")));
  }

  static TemporaryDirectory* directory_;
};

TemporaryDirectory* IdentifyProgram::directory_ = nullptr;

TEST_F(IdentifyProgram, NothingIsMissingInARecordOfOurOwnSimulationAndASecondTimeNoneIsMade) {
  record("plain", 1, [](double force, double) { return force; });
  const Outcome outcome = program("identify plain.csv --out plain_out --cache cache --no-report");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  auto json = report("plain_out");
  EXPECT_EQ(json["verdict"], "none") << outcome.text;
  EXPECT_TRUE(json["effects"].empty());
  EXPECT_TRUE(json["after"].is_null());
  EXPECT_GT(json["minimum_detectable"].size(), 10u);
  EXPECT_FALSE(json["next_experiment"].empty());

  ASSERT_EQ(program("identify plain.csv --out plain_out --cache cache --no-report").exit_code, 0);
  auto second = report("plain_out");
  EXPECT_EQ(second["runs"]["made"], 0);
  for (auto* each : {&json, &second}) each->erase("runs");
  EXPECT_EQ(json, second);
}

TEST_F(IdentifyProgram, ZeroErrorOfTheLoadCellIsNamedAndTheErrorFalls) {
  const auto biased = [](double force, double) { return force + 350.0; };
  record("biased", 2, biased);
  record("biased_again", 3, biased);
  const Outcome outcome =
      program("identify biased.csv --holdout biased_again.csv --out biased_out --cache cache --no-report");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  const auto json = report("biased_out");
  ASSERT_FALSE(json["effects"].empty()) << outcome.text;
  EXPECT_EQ(json["effects"][0], "load_cell_bias");
  EXPECT_LT(json["after"]["rmse_n"], 0.8 * json["baseline_refitted"]["rmse_n"].get<double>());
  EXPECT_LT(json["holdout"]["after"]["rmse_n"], json["holdout"]["baseline_refitted"]["rmse_n"]);
  const auto& parameter = json["ranking"][0]["parameters"][0];
  EXPECT_EQ(parameter["key"], "effects.load_cell_bias.bias_n");
  // This rig leans on the ice before it lifts, and what it carries there reads like a zero error, too.
  const SimulatedForce plain = readSimulatedForce(directory_->file("run"));
  const auto start = std::lower_bound(plain.time_s.begin(), plain.time_s.end(), -0.005) - plain.time_s.begin();
  const double at_rest_n = 350.0 + plain.force_n[static_cast<std::size_t>(start)];
  EXPECT_LT(parameter["low"], at_rest_n);
  EXPECT_GT(parameter["high"], at_rest_n);

  // The loop is closed: the overlay runs.
  const Outcome twin = program(
      "run small.yaml --overlay biased_out/overlay.yaml --set procedure.lift_duration_s=0.5 --set "
      "procedure.hold_duration_s=0 --out twin");
  EXPECT_EQ(twin.exit_code, 0) << twin.text;
  EXPECT_TRUE(contains(
      readFile(directory_->file("twin/scenario.yaml")), "bias_n: " + [&] {
        char text[32];
        std::snprintf(text, sizeof text, "%.4g", parameter["value"].get<double>());
        return std::string(text).substr(0, 3);
      }()));
}

/// The ranking's entry of one effect alone.
nlohmann::json entryOf(const nlohmann::json& report, const std::string& effect) {
  for (const auto& entry : report["ranking"]) {
    if (entry["name"] == effect) return entry;
  }
  return nullptr;
}

/// Whether all that could be named as it is was simulated, the fifth of the ranking as well.
bool whatCouldBeNamedWasSimulated(const nlohmann::json& report) {
  for (const auto& entry : report["ranking"]) {
    if (!entry["confirmed"] && entry["log_bayes_factor"] > entry["threshold"]) return false;
  }
  return true;
}

TEST_F(IdentifyProgram, ALongLagOfTheLoadCellIsFoundAtItsSize) {
  // Slopes about a cell without lag make a third of it.
  constexpr double kLagS = 1.5;
  const std::string clear = "run small.yaml --set procedure.start_gap_m=0.08 ";
  ASSERT_EQ(program(clear + "--out quick_cell_run").exit_code, 0);
  ASSERT_EQ(program(clear + "--set effects.load_cell_lag.enabled=true --set effects.load_cell_lag.lag_s=1.5 "
                            "--out slow_cell_run")
                .exit_code,
            0);
  record(
      "slow_cell", 12, [](double force, double) { return force; }, "slow_cell_run", false, 0.15, 0.0, "quick_cell_run");
  const Outcome outcome = program("identify slow_cell.csv --out slow_cell_out --cache cache --no-report");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  const auto lag = entryOf(report("slow_cell_out"), "load_cell_lag");
  ASSERT_TRUE(lag.is_object()) << outcome.text;
  EXPECT_TRUE(lag["confirmed"]) << lag;
  EXPECT_GT(lag["log_bayes_factor"], 10.0) << lag;
  EXPECT_GT(lag["detectability"], 8.0) << lag;
  EXPECT_NEAR(lag["parameters"][0]["value"].get<double>(), kLagS, 0.2) << lag;
  EXPECT_LT(lag["parameters"][0]["low"], kLagS);
  EXPECT_GT(lag["parameters"][0]["high"], kLagS);
}

/// The small field under 6 cm of swell, and its record. @param set  more keys of the scenario
class IdentifySwell : public IdentifyProgram {
 protected:
  /// @param rest_s  from which on it comes up  @param rig  run whose scenario the manifest names
  static void recordSwell(const std::string& name, unsigned seed, const std::string& set, double rest_s,
                          double speed_mps = 0.15, const std::string& rig = "run") {
    ASSERT_EQ(program("run small.yaml --set effects.vessel_heave.enabled=true "
                      "--set effects.vessel_heave.amplitude_1_m=0.06 --set procedure.rest_duration_s=" +
                      std::to_string(rest_s) + " " + set + " --out " + name + "_run")
                  .exit_code,
              0);
    record(
        name, seed, [](double force, double) { return force; }, name + "_run", false, speed_mps, rest_s, rig);
  }

  /// What is said of swell; everything that could be named was simulated.
  static void identifyHeave(const std::string& name, const std::string& holdout, nlohmann::json& heave) {
    const Outcome outcome = program("identify " + name + ".csv --holdout " + holdout + ".csv --out " + holdout +
                                    "_out --cache cache --no-report");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
    const auto json = report(holdout + "_out");
    EXPECT_TRUE(whatCouldBeNamedWasSimulated(json)) << outcome.text;
    heave = entryOf(json, "vessel_heave");
    ASSERT_TRUE(heave.is_object()) << outcome.text;
  }
};

TEST_F(IdentifySwell, ThatHasAnotherPhaseInTheHeldOutRecordIsConfirmedByIt) {
  recordSwell("swell", 6, "--set effects.vessel_heave.period_1_s=4", 8.0);
  recordSwell("other_phase", 7, "--set effects.vessel_heave.period_1_s=4 --set effects.vessel_heave.phase_1_deg=150",
              8.0);
  nlohmann::json heave;
  ASSERT_NO_FATAL_FAILURE(identifyHeave("swell", "other_phase", heave));
  EXPECT_GT(heave["log_bayes_factor"], 6.0) << heave;
  EXPECT_GT(heave["holdout_log_ratio"], 3.0) << heave;
  EXPECT_LT(heave["holdout_ratio"], 0.8) << heave;
  EXPECT_TRUE(heave["holdout_way_log_ratio"].is_null());  // both go at one speed
}

TEST_F(IdentifySwell, ThatKeepsItsLengthAlongTheWayIsTold) {
  // A drum does nothing before the lift, and neither does swell where the rig hangs clear of the ice.
  const std::string clear = "--set procedure.start_gap_m=0.08 ";
  ASSERT_EQ(program("run small.yaml " + clear + "--out clear").exit_code, 0);
  recordSwell("drum", 10, clear + "--set effects.vessel_heave.period_1_s=4", 0.0, 0.15, "clear");
  recordSwell("faster_drum", 11,
              clear +
                  "--set effects.vessel_heave.period_1_s=3 --set effects.vessel_heave.phase_1_deg=70 "
                  "--set procedure.lift_speed_mps=0.2 --set procedure.lift_duration_s=6",
              0.0, 0.2, "clear");
  nlohmann::json heave;
  ASSERT_NO_FATAL_FAILURE(identifyHeave("drum", "faster_drum", heave));
  ASSERT_TRUE(heave["holdout_way_log_ratio"].is_number()) << heave;
  EXPECT_GT(heave["holdout_way_log_ratio"], 6.0 + heave["holdout_log_ratio"].get<double>()) << heave;
}

TEST_F(IdentifyProgram, AFallThatDoesNotComeBackIsNotHeldAgainstIt) {
  const auto same = [](double force, double) { return force; };
  // A rig that hangs clear and a cell as noisy as in the field: else what a small field's blocks do by chance is seen
  // as well as a fall.
  const std::string clear = "run small.yaml --set procedure.start_gap_m=0.08 ";
  constexpr double kNoiseN = 100.0;
  ASSERT_EQ(program(clear + "--out no_fall_run").exit_code, 0);
  ASSERT_EQ(program(clear + "--set effects.block_drop.enabled=true --set effects.block_drop.mass_1_kg=60 "
                            "--set effects.block_drop.time_1_s=9 --out fall_run")
                .exit_code,
            0);
  record("fall", 8, same, "fall_run", false, 0.15, 0.0, "no_fall_run", kNoiseN);
  record("no_fall", 9, same, "no_fall_run", false, 0.15, 0.0, "no_fall_run", kNoiseN);
  // Ice that is known: fitted otherwise with the fall, it costs up to eight nats more.
  for (const char* name : {"fall.yaml", "no_fall.yaml"}) {
    directory_->put(name,
                    "source: synthetic\ntare_n: 0\nposition: measured\nrig: no_fall_run/scenario.yaml\n"
                    "ice: {thickness_m: 0.6, void_fraction: 0.6 ± 0.0003, cohesion_pa: 200 ± 0.5, "
                    "friction_angle_deg: 50 ± 0.03}\n");
  }
  const Outcome outcome = program("identify fall.csv --holdout no_fall.csv --out fall_out --cache cache --no-report");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  const auto fall = entryOf(report("fall_out"), "block_drop");
  ASSERT_TRUE(fall.is_object()) << outcome.text;
  const double worth = fall["log_bayes_factor"];
  EXPECT_GT(worth, 40.0) << outcome.text;
  // Had it to come back, it would cost about what it is worth here. A toss of a coin costs 0.7; the water under the rim
  // is fitted otherwise, too, and four draws of the noise have -2.9, 0.3, 1.2 and -1.6.
  EXPECT_GT(fall["holdout_log_ratio"], -5.0) << outcome.text;
}

class IdentifyTilt : public IdentifyProgram {
 protected:
  /// The first explanation of a record with lateral channels of a pole that moves towards 40 degrees.
  static nlohmann::json firstOf(const std::string& name, const std::string& motion) {
    const Outcome run = program(
        "run small.yaml --set effects.pole_tilt.enabled=true "
        "--set effects.pole_tilt.direction_deg=40 " +
        motion + " --out " + name + "_run");
    EXPECT_EQ(run.exit_code, 0) << run.text;
    record(
        name, 5, [](double force, double) { return force; }, name + "_run", true);
    const Outcome outcome =
        program("identify " + name + ".csv --screen --out " + name + "_out --cache cache --no-report");
    EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
    return report(name + "_out")["ranking"][0];
  }
  static void expectTilt(const nlohmann::json& first, const std::string& shape) {
    EXPECT_EQ(first["name"], "pole_tilt");
    EXPECT_NE(first["shape"].get<std::string>().find(shape), std::string::npos) << first["shape"];
    EXPECT_GT(first["log_bayes_factor"], 6.0);
    const auto& direction = first["parameters"].back();
    EXPECT_EQ(direction["key"], "effects.pole_tilt.direction_deg");
    EXPECT_LT(direction["low"], 40.0);
    EXPECT_GT(direction["high"], 40.0);
  }
};

TEST_F(IdentifyTilt, OfAnUprightPoleIsSeenByTheIceThatItPushesAndWhereTo) {
  expectTilt(firstOf("upright", "--set effects.pole_tilt.drift_mps=0.02 --set effects.pole_tilt.lean_ratio=0"),
             "lean_ratio = 0");
}

/// Before anything is simulated the lateral channels tell that it leans, and the period of its sway.
TEST_F(IdentifyTilt, OfALeaningPoleIsSeenByTheLateralChannelsAndWhereTo) {
  const auto first = firstOf("leaning",
                             "--set effects.pole_tilt.drift_mps=0 --set effects.pole_tilt.sway_m=0.3 "
                             "--set effects.pole_tilt.sway_period_s=9.1");
  expectTilt(first, "lean_ratio = 1, sway_period_s = 9.09");
  EXPECT_EQ(first["parameters"][0]["key"], "effects.pole_tilt.sway_m");
}

TEST_F(IdentifyProgram, GarbageIsRefusedAndLeavesNoReport) {
  directory_->put("garbage.csv", "time_s,force_n,hoist_position_m\n0,nan,0\n1,x,0\n");
  directory_->put("garbage.yaml", "source: field\n");
  const Outcome outcome = program("identify garbage.csv --out garbage_out --no-report");
  EXPECT_EQ(outcome.exit_code, 2) << outcome.text;
  EXPECT_TRUE(contains(outcome.text, "too_few_samples")) << outcome.text;
  EXPECT_FALSE(std::ifstream(directory_->file("garbage_out/report.json")).good());
}

TEST_F(IdentifyProgram, ARecordThatIsGivenTwiceIsRefused) {
  const auto plain = [](double force, double) { return force; };
  record("once", 20, plain);
  record("twice", 20, plain);
  record("other", 21, plain);
  const auto expectRefused = [](const std::string& arguments, const std::string& said) {
    const Outcome outcome = program("identify " + arguments + " --out given_twice --no-report");
    EXPECT_EQ(outcome.exit_code, 2) << outcome.text;
    EXPECT_TRUE(contains(outcome.text, said)) << outcome.text;
    EXPECT_FALSE(std::ifstream(directory_->file("given_twice/report.json")).good());
  };
  expectRefused("once.csv --holdout once.csv", "is the held-out record, but its samples are those of once.csv");
  expectRefused("once.csv twice.csv", "twice.csv: is a record to be fitted, but");
  expectRefused("once.csv --reference other.csv --reference twice.csv", "twice.csv: is a reference, but");
  expectRefused("once.csv --reference other.csv --reference other.csv", "those of other.csv, a reference: each record");
}

TEST_F(IdentifyProgram, RecordWithoutIceCannotTell) {
  record("empty", 4, [](double, double empty_force) { return empty_force; });
  const Outcome outcome = program("identify empty.csv --out empty_out --cache cache --no-report");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_EQ(report("empty_out")["verdict"], "cannot_tell") << outcome.text;
}

}  // namespace
}  // namespace brash_ice_rig
