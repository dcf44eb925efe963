#include "brash_ice_rig/output/run_writer.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "brash_ice_rig/config/scenario_reader.h"
#include "temporary_directory.h"

namespace brash_ice_rig {
namespace {

Scenario smallScenario() {
  Scenario scenario;
  scenario.title = "Small field";
  scenario.field.length_x_m = 3.0;
  scenario.field.length_y_m = 3.0;
  scenario.field.thickness_m = 0.6;
  scenario.collector.radius_m = 0.6;
  scenario.load_cell.rate_hz = 2.0;
  scenario.solver.threads = 1;
  return scenario;
}

Snapshot sampleAt(double time_s, Stage stage, double force_n, double ice_n) {
  Snapshot snapshot;
  snapshot.time_s = time_s;
  snapshot.stage = stage;
  snapshot.force_n = force_n;
  snapshot.components.ice_normal_n = 0.75 * ice_n;
  snapshot.components.ice_friction_n = 0.25 * ice_n;
  return snapshot;
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) parts.push_back(part);
  return parts;
}

class RunWriterTest : public ::testing::Test {
 protected:
  TemporaryDirectory directory_;
  Simulation simulation_{smallScenario()};
};

TEST_F(RunWriterTest, EffectiveScenarioIsThereFromTheStartAndReadsBack) {
  const RunWriter writer(simulation_, directory_.file("a/b"));
  ScenarioSources sources;
  sources.file = writer.scenarioPath();
  EXPECT_EQ(toYaml(loadScenario(sources)), toYaml(simulation_.scenario()));
}

TEST_F(RunWriterTest, RowHoldsTheSnapshotBitForBit) {
  Snapshot snapshot = sampleAt(1.0 / 3.0, Stage::kLift, 12345.678901234567, 0.1);
  snapshot.tension_n = 12345.7;
  snapshot.rig.hoist_position_m = -1.0 / 7.0;
  snapshot.rig.crane_velocity_mps.z() = 0.052;
  snapshot.rig.commanded_velocity_mps.z() = 0.053;
  snapshot.rig.fold_ratio = 0.9;
  snapshot.ice_force_n = {1.5, -2.5, -0.1};
  snapshot.load_cell_force_n = {3.5, -4.5, 12345.678901234567};
  snapshot.components.plug_friction_n = 77.7;

  RunWriter writer(simulation_, directory_.path());
  writer.write(snapshot, StatusFlags());
  writer.finish(simulation_, RunTiming(), false);

  const std::vector<std::string> lines = split(readFile(writer.forcePath()), '\n');
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].rfind("time_s,force_n,hoist_position_m,hoist_speed_mps,fold_ratio,stage,", 0), 0u);
  const std::vector<std::string> names = split(lines[0], ',');
  const std::vector<std::string> cells = split(lines[1], ',');
  ASSERT_EQ(names.size(), cells.size());
  const auto valueOf = [&](const std::string& name) {
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (names[i] == name) return std::strtod(cells[i].c_str(), nullptr);
    }
    ADD_FAILURE() << "no column " << name;
    return std::nan("");
  };
  EXPECT_EQ(valueOf("time_s"), 1.0 / 3.0);
  EXPECT_EQ(valueOf("force_n"), 12345.678901234567);
  EXPECT_EQ(valueOf("hoist_position_m"), -1.0 / 7.0);
  EXPECT_EQ(valueOf("hoist_speed_mps"), 0.052);
  EXPECT_EQ(valueOf("fold_ratio"), 0.9);
  EXPECT_EQ(cells[5], "lift");
  EXPECT_EQ(valueOf("tension_n"), 12345.7);
  EXPECT_EQ(valueOf("ice_force_x_n"), 1.5);
  EXPECT_EQ(valueOf("ice_force_y_n"), -2.5);
  EXPECT_EQ(valueOf("ice_force_z_n"), -0.1);
  EXPECT_EQ(valueOf("ice_normal_n"), snapshot.components.ice_normal_n);
  EXPECT_EQ(valueOf("ice_friction_n"), snapshot.components.ice_friction_n);
  EXPECT_EQ(valueOf("plug_friction_n"), 77.7);
  EXPECT_EQ(valueOf("force_x_n"), 3.5);
  EXPECT_EQ(valueOf("force_y_n"), -4.5);
  EXPECT_EQ(valueOf("hoist_command_mps"), 0.053);
}

TEST_F(RunWriterTest, StatisticsLeaveOutSettlingAndWhatFollowsTheScript) {
  RunWriter writer(simulation_, directory_.path());
  writer.write(sampleAt(-0.5, Stage::kSettle, 1.0e6, 1.0e6), StatusFlags());
  for (int i = 0; i < 20; ++i) writer.write(sampleAt(0.5 * i, Stage::kLift, 100.0 + i, i), StatusFlags());
  for (int i = 20; i < 40; ++i) writer.write(sampleAt(0.5 * i, Stage::kDone, 1.0e6, 1.0e6), StatusFlags());
  const RunSummary summary = writer.finish(simulation_, RunTiming(), false);
  // 2 Hz: three samples in the peak's window (17 18 19), nine in the residual's (11 to 19).
  EXPECT_DOUBLE_EQ(summary.peak_force_n, 118.0);
  EXPECT_DOUBLE_EQ(summary.peak_time_s, 9.0);
  EXPECT_DOUBLE_EQ(summary.residual_force_n, 115.0);
  EXPECT_DOUBLE_EQ(summary.ice_peak_force_n, 18.0);
  EXPECT_DOUBLE_EQ(summary.ice_residual_force_n, 15.0);
}

TEST_F(RunWriterTest, SummaryCountsTheStepsOfThisRunOnly) {
  simulation_.advance(simulation_.samplePeriod());
  RunWriter writer(simulation_, directory_.path());
  const StepReport report = simulation_.advance(simulation_.samplePeriod());
  writer.write(simulation_.snapshot(), report.flags);
  RunTiming timing;
  timing.wall_s = 2.0;
  timing.compute_s = 1.0;
  const RunSummary summary = writer.finish(simulation_, timing, false);
  EXPECT_EQ(summary.step_count, report.steps);
  EXPECT_NEAR(summary.simulated_s, simulation_.samplePeriod(), 1e-12);
  EXPECT_NEAR(summary.real_time_factor, simulation_.samplePeriod() / 2.0, 1e-12);
  const double particle_steps = static_cast<double>(report.steps * simulation_.particleCount());
  EXPECT_NEAR(summary.ns_per_particle_step, 1.0e9 / particle_steps, 1e-6);
  EXPECT_EQ(summary.state_hash, simulation_.stateHash());
  EXPECT_EQ(YAML::LoadFile(writer.summaryPath())["step_count"].as<std::uint64_t>(), report.steps);
}

TEST_F(RunWriterTest, FlagsOfAnyMomentReachTheStatus) {
  RunWriter writer(simulation_, directory_.path());
  StatusFlags raised;
  raised.set(StatusFlag::kContactSaturated);
  Snapshot with_flag = sampleAt(0.5, Stage::kLift, 1.0, 1.0);
  with_flag.flags.set(StatusFlag::kFoldJammed);
  writer.write(sampleAt(0.0, Stage::kLift, 1.0, 1.0), raised);
  writer.write(with_flag, StatusFlags());
  writer.write(sampleAt(1.0, Stage::kLift, 1.0, 1.0), StatusFlags());
  const std::string status = writer.finish(simulation_, RunTiming(), false).status;
  EXPECT_NE(status.find("contact_saturated: "), std::string::npos) << status;
  EXPECT_NE(status.find("fold_jammed: "), std::string::npos) << status;
}

TEST_F(RunWriterTest, EnergyGoesIntoATableOfItsOwnAndIntoTheSummary) {
  Scenario scenario = smallScenario();
  scenario.output.energy = true;
  Simulation simulation(scenario);
  RunWriter writer(simulation, directory_.path());
  Snapshot snapshot = sampleAt(0.5, Stage::kLift, 1.0, 1.0);
  snapshot.energy.emplace();
  snapshot.energy->crane_work_j = 400.0;
  snapshot.energy->work_on_ice_j = 300.0;
  snapshot.energy->plastic_j = 1.0 / 3.0;
  writer.write(snapshot, StatusFlags());
  const RunSummary summary = writer.finish(simulation, RunTiming(), false);
  const std::vector<std::string> lines = split(readFile(writer.energyPath()), '\n');
  ASSERT_EQ(lines.size(), 2u);
  const std::vector<std::string> names = split(lines[0], ','), cells = split(lines[1], ',');
  ASSERT_EQ(names.size(), kEnergyTerms.size() + 4);
  ASSERT_EQ(cells.size(), names.size());
  EXPECT_EQ(names[0], "time_s");
  EXPECT_EQ(cells[0], "0.5");
  for (std::size_t k = 0; k < kEnergyTerms.size(); ++k) {
    EXPECT_EQ(names[k + 1], kEnergyTerms[k].name);
    EXPECT_EQ(std::strtod(cells[k + 1].c_str(), nullptr), (*snapshot.energy).*kEnergyTerms[k].value) << names[k + 1];
  }
  EXPECT_EQ(names[names.size() - 3], "rig_imbalance_j");
  EXPECT_EQ(cells[names.size() - 3], "100");
  EXPECT_EQ(summary.energy_crane_work_j, 400.0);
  EXPECT_NEAR(summary.energy_imbalance_ratio, (400.0 - 1.0 / 3.0) / 400.0, 1e-12);
}

TEST_F(RunWriterTest, WithoutEnergyThereIsNoTableNotEvenAnEarlierOne) {
  directory_.put("energy.csv", "time_s\n");
  RunWriter writer(simulation_, directory_.path());
  writer.write(sampleAt(0.5, Stage::kLift, 1.0, 1.0), StatusFlags());
  EXPECT_TRUE(std::isnan(writer.finish(simulation_, RunTiming(), false).energy_crane_work_j));
  EXPECT_FALSE(std::filesystem::exists(writer.energyPath()));
}

TEST_F(RunWriterTest, UnfinishedRunHasNoSummaryEvenWhereAnEarlierRunLeftOne) {
  directory_.put("summary.json", "{}");
  {
    RunWriter writer(simulation_, directory_.path());
    writer.write(sampleAt(0.0, Stage::kLift, 1.0, 1.0), StatusFlags());
  }
  EXPECT_FALSE(std::filesystem::exists(directory_.file("summary.json")));
  EXPECT_TRUE(std::filesystem::exists(directory_.file("force.csv")));
}

TEST_F(RunWriterTest, FullDiskStopsTheRunAndLeavesNoSummary) {
  std::filesystem::create_symlink("/dev/full", directory_.file("force.csv"));
  EXPECT_THROW(RunWriter(simulation_, directory_.path()), OutputError);
  EXPECT_FALSE(std::filesystem::exists(directory_.file("summary.json")));
}

// ---- plug.csv

TEST_F(RunWriterTest, PlugHasARowEachHalfSecondFromTimeZero) {
  // Samples every 0.5 s would not tell; 8 Hz do.
  Scenario scenario = smallScenario();
  scenario.load_cell.rate_hz = 8.0;
  scenario.procedure.settle_duration_s = 0.5;
  Simulation simulation(scenario);
  RunWriter writer(simulation, directory_.path());
  while (simulation.snapshot().time_s < 1.3) {
    simulation.advance(simulation.samplePeriod());
    writer.writePlugIfDue(simulation, simulation.snapshot());
  }
  const PlugSummary plug = simulation.plug();
  ASSERT_GT(plug.bulge_height_m, 0.0);
  writer.writePlugIfDue(simulation, sampleAt(7.1, Stage::kLift, 0.0, 0.0));  // after a pause: late, but there
  writer.finish(simulation, RunTiming(), false);

  const std::vector<std::string> lines = split(readFile(writer.plugPath()), '\n');
  EXPECT_EQ(lines[0],
            "time_s,lifted_mass_kg,raised_particles,radius_at_waterline_m,radius_at_top_m,hole_sites,hole_refill_ratio,"
            "hole_cover_ratio,bulge_height_m,bulge_radius_m");
  ASSERT_EQ(lines.size(), 5u);
  EXPECT_NEAR(std::stod(lines[1]), 0.0, 1e-12);
  EXPECT_NEAR(std::stod(lines[2]), 0.5, 1e-12);
  EXPECT_NEAR(std::stod(lines[3]), 1.0, 1e-12);
  const std::vector<std::string> cells = split(lines[4], ',');
  ASSERT_EQ(cells.size(), 10u);
  EXPECT_EQ(std::stod(cells[0]), 7.1);
  EXPECT_EQ(std::stod(cells[1]), plug.lifted_mass_kg);
  EXPECT_EQ(std::stoul(cells[2]), plug.raised_particles);
  EXPECT_EQ(std::stod(cells[8]), plug.bulge_height_m);
  EXPECT_EQ(std::stod(cells[9]), plug.bulge_radius_m);
}

}  // namespace
}  // namespace brash_ice_rig
