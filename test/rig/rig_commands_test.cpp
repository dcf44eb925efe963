#include "brash_ice_rig/rig/rig_commands.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "../output/temporary_directory.h"
#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/simulation/simulation.h"

namespace brash_ice_rig {
namespace {

class RigCommands : public ::testing::Test {
 protected:
  std::string refusal(const std::string& text) {
    try {
      readCommands(directory_.put("commands.csv", text));
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "taken";
  }

  TemporaryDirectory directory_;
};

TEST_F(RigCommands, FileGivesBackTheSameBits) {
  RigCommand a, b, c;
  a.time_s = -0.1 / 3.0;
  a.velocity_mps = Eigen::Vector3d(0.1, -1.0 / 3.0, 1e-300);
  b.time_s = 2.0 / 7.0;
  b.fold_target = 1.0 / 3.0;
  b.tare = true;
  b.load_cell_noise_n = 1.0 / 7.0;
  b.load_cell_resolution_n = 0.0;
  c.time_s = 1e3 / 7.0;
  const std::vector<RigCommand> read =
      readCommands(directory_.put("commands.csv", kCommandsHeader + toCsvRow(a) + toCsvRow(b) + toCsvRow(c)));
  ASSERT_EQ(read.size(), 3u);
  EXPECT_EQ(read[0].time_s, a.time_s);
  EXPECT_EQ(*read[0].velocity_mps, *a.velocity_mps);
  EXPECT_FALSE(read[0].fold_target || read[0].tare || read[0].load_cell_noise_n || read[0].load_cell_resolution_n);
  EXPECT_EQ(read[1].fold_target, b.fold_target);
  EXPECT_TRUE(read[1].tare);
  EXPECT_EQ(read[1].load_cell_noise_n, b.load_cell_noise_n);
  EXPECT_EQ(read[1].load_cell_resolution_n, b.load_cell_resolution_n);
  EXPECT_FALSE(read[1].velocity_mps);
  EXPECT_EQ(read[2].time_s, c.time_s);
  EXPECT_TRUE(read[2].empty());
}

TEST_F(RigCommands, HandwrittenFileNeedsOnlyTheColumnsThatItUses) {
  const auto read = readCommands(directory_.put("commands.csv", "# up\ntime_s,velocity_z_mps\n0,0.05\n2,\n"));
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(*read[0].velocity_mps, Eigen::Vector3d(0.0, 0.0, 0.05));
}

TEST_F(RigCommands, WrongFileIsRefusedWithItsLine) {
  const std::string columns = "time_s,velocity_z_mps,fold_target,tare\n";
  const std::vector<std::vector<std::string>> cases = {
      {"velocity_z_mps\n1\n", "must have a column time_s"},
      {"time_s,force_n\n1,2\n", "must have one of the columns"},
      {columns + "0,1,1,\n0,1,1,\n", "line 3: time_s must increase"},
      {columns + ",1,1,\n", "line 2: time_s must be a number"},
      {columns + "0,inf,,\n", "line 2: velocity_z_mps must be finite"},
      {columns + "0,fast,,\n", "line 2: velocity_z_mps must be a number or empty, is `fast`"},
      {columns + "0,,1.5,\n", "line 2: fold_target must lie in 0..1"},
      {columns + "0,,,2\n", "line 2: tare must be 0, 1 or empty"},
      {columns + "0,1,1,\n1,0.0", "the last line is cut off"},
      {"time_s,load_cell_noise_n\n0,-1\n", "line 2: load_cell.noise_n = -1, must lie in [0, 100000]"},
      {"time_s,load_cell_resolution_n\n0,200000\n", "line 2: load_cell.resolution_n = 200000, must lie in [0, 100000]"},
  };
  for (const auto& wrong : cases) {
    const std::string message = refusal(wrong[0]);
    EXPECT_NE(message.find(wrong[1]), std::string::npos) << message;
    EXPECT_NE(message.find("procedure.commands_file"), std::string::npos) << message;
  }
}

Scenario handDriven() {
  Scenario s;
  s.field.length_x_m = s.field.length_y_m = 3.0;
  s.field.thickness_m = 0.6;
  s.collector.radius_m = 0.6;
  s.load_cell.noise_n = 20.0;
  s.load_cell.lag_s = 0.05;
  s.solver.threads = 1;
  s.procedure.control = ControlMode::kManual;
  s.procedure.settle_duration_s = 0.2;
  return s;
}

TEST_F(RigCommands, RunThatWasDrivenByHandRepeatsToTheLastBit) {
  const Scenario scenario = handDriven();
  Simulation live(scenario);
  std::string file = kCommandsHeader;
  std::vector<double> readings;
  double end_s = 0.0;
  for (int i = 0; i < 240; ++i) {
    // An operator at the stick: up and sideways, a pause that the watchdog ends, a fold, a tare, and nonsense.
    if (i % 7 == 0 && (i < 100 || i > 150)) live.setCraneVelocity({0.03, -0.01, i < 200 ? 0.2 : -0.1});
    if (i == 5 || i == 60) live.setFoldTarget(i == 5 ? 0.95 : 1.0);
    if (i == 30) live.tare();
    if (i == 40) live.setLoadCellNoise(80.0);
    if (i == 90) live.setLoadCellResolution(50.0);
    if (i == 210) live.setCraneVelocity({0.0, 0.0, std::nan("")});
    // Steps do not fall on samples: commands come at any of them.
    for (const double share : {0.5, 1.0}) {
      const StepReport report = live.advance(0.5 * live.samplePeriod());
      for (const RigCommand& command : report.commands) file += toCsvRow(command);
      if (share == 0.5 && i == 61) live.setCraneVelocity({0.0, 0.0, 0.3});
    }
    readings.push_back(live.snapshot().force_n);
    end_s = live.snapshot().time_s;
  }
  RigCommand end;
  end.time_s = end_s;
  file += toCsvRow(end);

  Scenario again = scenario;
  again.procedure.commands_file = directory_.put("commands.csv", file);
  Simulation replay(again);
  for (const double reading : readings) {
    EXPECT_FALSE(replay.finished());
    replay.setCraneVelocity({0.0, 0.0, 0.4});  // nobody drives beside the file
    const StepReport report = replay.advance(replay.samplePeriod());
    EXPECT_TRUE(report.flags.has(StatusFlag::kCommandIgnored));
    ASSERT_EQ(replay.snapshot().force_n, reading);
  }
  EXPECT_EQ(replay.stateHash(), live.stateHash());
  EXPECT_GT(live.snapshot().rig.crane_position_m.x(), 0.02);
  replay.advance(replay.samplePeriod());
  EXPECT_TRUE(replay.finished());
  EXPECT_EQ(replay.snapshot().stage, Stage::kDone);

  // Without its sideways pushes, it would have been another run.
  Scenario straight = again;
  straight.procedure.commands_file = directory_.put("straight.csv", "time_s,velocity_z_mps\n0,0.2\n3,0\n");
  Simulation other(straight);
  other.advance(2.4);
  EXPECT_NE(other.stateHash(), live.stateHash());
}

TEST_F(RigCommands, NoiseAndResolutionHoldFromTheNextSampleOnAndAreToldOnce) {
  Scenario s = handDriven();
  s.procedure.control = ControlMode::kScripted;
  s.load_cell.noise_n = s.load_cell.lag_s = 0.0;
  Simulation quiet(s), changed(s);
  quiet.advance(0.05);
  changed.advance(0.05);
  changed.setLoadCellNoise(1000.0);
  EXPECT_EQ(changed.loadCellNoise(), 1000.0) << "what will hold is known before the step that obeys";
  EXPECT_EQ(changed.snapshot().force_n, quiet.snapshot().force_n);
  double square = 0.0;
  constexpr int kSamples = 100;
  for (int i = 0; i < kSamples; ++i) {
    const StepReport report = changed.advance(changed.samplePeriod());
    EXPECT_EQ(report.commands.size(), i == 0 ? 1u : 0u);
    quiet.advance(quiet.samplePeriod());
    const double error_n = changed.snapshot().force_n - quiet.snapshot().force_n;
    EXPECT_NE(error_n, 0.0) << i;
    square += error_n * error_n / kSamples;
  }
  EXPECT_NEAR(std::sqrt(square), 1000.0, 4.0 * 1000.0 / std::sqrt(2.0 * kSamples));

  changed.setLoadCellNoise(0.0);
  changed.setLoadCellResolution(250.0);
  changed.advance(changed.samplePeriod());
  EXPECT_EQ(changed.loadCellNoise(), 0.0);
  EXPECT_EQ(std::remainder(changed.snapshot().force_n, 250.0), 0.0);
  EXPECT_EQ(changed.snapshot().tension_n, [&] {
    quiet.advance(quiet.samplePeriod());
    return quiet.snapshot().tension_n;
  }()) << "what the cell reads does not reach the rig";
}

TEST_F(RigCommands, ScriptTakesATareFromTheFileAndNothingElse) {
  Scenario s = handDriven();
  s.procedure.control = ControlMode::kScripted;
  s.procedure.lift_duration_s = 0.5;
  s.load_cell.noise_n = s.load_cell.lag_s = 0.0;
  s.procedure.commands_file = directory_.put("commands.csv", "time_s,velocity_z_mps,tare\n-0.1,,1\n9,,\n");
  Simulation simulation(s);
  simulation.advance(0.05);
  EXPECT_GT(simulation.snapshot().force_n, 1000.0);
  simulation.advance(0.1);
  EXPECT_LT(std::abs(simulation.snapshot().force_n), 100.0);
  s.procedure.commands_file = directory_.put("commands.csv", "time_s,velocity_z_mps\n0,0.1\n");
  try {
    s.validate();
    ADD_FAILURE() << "taken";
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("needs procedure.control: manual"), std::string::npos) << error.what();
  }
  s.procedure.commands_file = directory_.put("commands.csv", "time_s,tare\n-30,1\n");
  EXPECT_THROW(s.validate(), ConfigError);
}

}  // namespace
}  // namespace brash_ice_rig
