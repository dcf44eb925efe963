#include "brash_ice_rig/identify/replay.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "../output/shell.h"
#include "../output/temporary_directory.h"
#include "brash_ice_rig/identify/measured_force.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/rig/crane_motion.h"

namespace brash_ice_rig {
namespace {

TEST(MeasuredForce, GivesBackSamplesAndStraightLinesAndNothingInGaps) {
  const MeasuredForce measured({1.0, 1.1, 2.0}, {10.0, 0.1 + 0.2, 40.0});
  EXPECT_EQ(measured.at(1.1), 0.1 + 0.2);
  EXPECT_EQ(measured.at(1.1 + 5e-10), 0.1 + 0.2) << "a stamp rounded to ns";
  EXPECT_NEAR(*measured.at(1.05), 5.15, 1e-9);
  EXPECT_FALSE(measured.at(1.5)) << "a gap of 0.9 s";
  EXPECT_FALSE(measured.at(0.99));
  EXPECT_FALSE(measured.at(2.01));
  EXPECT_EQ(measured.at(2.0), 40.0);
}

TEST(MeasuredForce, FileThatIsNoneIsRefused) {
  const TemporaryDirectory directory;
  const auto refusal = [&](const std::string& text) {
    try {
      MeasuredForce::read(directory.put("m.csv", text));
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  EXPECT_TRUE(contains(refusal("time_s,hoist_position_m\n0,1\n"), "must have columns time_s and force_n"));
  EXPECT_TRUE(contains(refusal("time_s,force_n\n1,1\n1,1\n"), "line 3: time_s must increase"));
  EXPECT_TRUE(contains(refusal("time_s,force_n\n,1\n1,\n"), "holds no row"));
}

class ReplayProgram : public ::testing::Test {
 protected:
  static constexpr const char* kScenario =
      "title: Small field\n"
      "field: {length_x_m: 3.0, length_y_m: 3.0, thickness_m: 0.6}\n"
      "collector: {radius_m: 0.6}\n"
      "load_cell: {noise_n: 20.0, lag_s: 0.1}\n"
      "procedure: {settle_duration_s: 2.0, lift_speed_mps: 0.2, lift_duration_s: 4.0, hold_duration_s: 1.0}\n"
      "solver: {threads: 1}\n";

  Outcome program(const std::string& arguments) const {
    return runShell("cd '" + directory_.path() + "' && '" BRASH_ICE_PROGRAM "' " + arguments);
  }

  bool sameFiles(const std::string& a, const std::string& b) const {
    return readFile(directory_.file(a)) == readFile(directory_.file(b));
  }

  TemporaryDirectory directory_;
  std::string scenario_ = directory_.put("small.yaml", kScenario);
};

TEST_F(ReplayProgram, RecordedRunIsARecordThatRepeatsToTheLastBit) {
  const Outcome run = program("run small.yaml --out run --record records/first");
  ASSERT_EQ(run.exit_code, 0) << run.text;
  const Outcome check = program("check records/first.csv records");
  EXPECT_EQ(check.exit_code, 0) << check.text;
  EXPECT_TRUE(contains(check.text, "record \"Small field\" (synthetic)")) << check.text;
  // The empty rig: 240 kg, 20 litres of collector and the pole's 1.5 m in the water.
  EXPECT_TRUE(contains(readFile(directory_.file("records/first.yaml")), "tare_n: 20")) << "kN of a rig in the water";

  const Outcome replay = program("replay records/first --out again");
  ASSERT_EQ(replay.exit_code, 0) << replay.text;
  EXPECT_TRUE(contains(replay.text, "a run of this simulation")) << replay.text;
  EXPECT_TRUE(contains(replay.text, "rms difference 0 N, 701 identical to the last bit")) << replay.text;
  EXPECT_TRUE(sameFiles("again/force.csv", "run/force.csv"));

  // Another seed of the noise, and nothing is identical any more.
  const Outcome other = program("replay records/first --set load_cell.seed=9 --out other");
  EXPECT_FALSE(contains(other.text, "rms difference 0 N")) << other.text;
}

TEST_F(ReplayProgram, RecordHoldsAllThatARunFollowed) {
  // A motion file and commands, which are gone when the record is replayed elsewhere.
  directory_.put("way.csv", "time_s,hoist_position_m\n0,0\n1,0.1\n2,0.3\n3,0.2\n");
  directory_.put("tare.csv", "time_s,tare\n-0.5,1\n4,\n");
  const Outcome run = program(
      "run small.yaml --out run --record there/ --set procedure.motion_file=way.csv"
      " --set procedure.commands_file=tare.csv");
  ASSERT_EQ(run.exit_code, 0) << run.text;
  std::filesystem::remove(directory_.file("way.csv"));
  std::filesystem::remove(directory_.file("tare.csv"));
  std::filesystem::rename(directory_.file("there"), directory_.file("moved"));
  const Outcome replay = program("replay moved --out again");
  ASSERT_EQ(replay.exit_code, 0) << replay.text;
  EXPECT_TRUE(sameFiles("again/force.csv", "run/force.csv"));
  EXPECT_EQ(program("replay again/none --out x").exit_code, 2);
}

TEST_F(ReplayProgram, HandMadeCommandsDriveARunThatEndsWithThem) {
  std::string commands = "time_s,velocity_x_mps,velocity_z_mps,fold_target\n";
  for (int i = 0; i < 15; ++i) commands += toText(0.2 * i) + ",0.02,0.1," + (i == 3 ? "0.9" : "") + "\n";
  directory_.put("commands.csv", commands + "3.5,,,\n");
  const std::string manual = " --set procedure.control=manual --set procedure.commands_file=commands.csv";
  const Outcome run = program("run small.yaml --out run --record byhand.csv" + manual);
  ASSERT_EQ(run.exit_code, 0) << run.text;
  ASSERT_EQ(program("replay byhand.yaml --out again").exit_code, 0);
  EXPECT_TRUE(sameFiles("again/force.csv", "run/force.csv"));
  const std::string rows = readFile(directory_.file("run/force.csv"));
  EXPECT_EQ(std::count(rows.begin(), rows.end(), '\n'), 1 + 551) << "2 s of rest, 3.5 s, the sample of the end";
  EXPECT_TRUE(contains(program("run small.yaml --set procedure.control=manual").text, "or procedure.commands_file"));
}

TEST_F(ReplayProgram, ForeignRecordMovesTheHoistAndGetsTheSimulatedZero) {
  // 5 s at rest, up 1 m in 5 s, rest; the load cell was zeroed with 300 N on it.
  std::string csv = "time_s,force_n,hoist_position_m\n";
  for (int i = 0; i <= 600; ++i) {
    const double t = 50.0 + 0.02 * i, up = std::clamp((t - 55.0) / 5.0, 0.0, 1.0);
    csv += toText(t) + ',' + toText(300.0 + std::round(2000.0 * up + 15.0 * std::sin(7.0 * i))) + ',' +
           toText(-3.0 + up + 0.0005 * std::round(std::sin(3.0 * i))) + '\n';
  }
  directory_.put("field.csv", csv);
  directory_.put("field.yaml", "source: field\ntare_n: 300\nrig: small.yaml\n");
  const Outcome replay = program("replay field.csv --out out --set load_cell.noise_n=0");
  ASSERT_EQ(replay.exit_code, 0) << replay.text;
  EXPECT_TRUE(contains(replay.text, "the hoist follows the record's hoist_position_m")) << replay.text;
  EXPECT_TRUE(contains(replay.text, "0 s of the replay is 50 s of the record")) << replay.text;
  const CraneMotion motion = CraneMotion::read(directory_.file("out/motion.csv"));
  EXPECT_NEAR(motion.wayAt(7.5), 0.5, 0.02);
  EXPECT_LT(motion.fastest(), 0.23) << "steps of the encoder are no speed";
  const MeasuredForce measured = MeasuredForce::read(directory_.file("out/measured.csv"));
  EXPECT_NEAR(measured.start(), 0.0, 1e-9);
  // At rest it reads what the simulated empty rig weighs in the water, within its noise.
  const MeasuredForce simulated = MeasuredForce::read(directory_.file("out/force.csv"));
  EXPECT_NEAR(*measured.at(2.0), *simulated.at(2.0), 20.0);
  EXPECT_TRUE(contains(replay.text, "measured and simulated force: ")) << replay.text;
}

TEST_F(ReplayProgram, LoweringOfAForeignRecordIsLeftOut) {
  std::string csv = "time_s,force_n,hoist_position_m\n";
  for (int i = 0; i <= 1500; ++i) {
    const double t = 0.02 * i;
    const double height = 1.0 - 2.5 * std::clamp((t - 3.0) / 7.0, 0.0, 1.0) + std::clamp((t - 17.0) / 6.0, 0.0, 1.0);
    const double force = 100.0 * std::sin(11.0 * i) + (t > 17.0 ? 3000.0 * std::min(1.0, (t - 17.0) / 3.0) : 0.0);
    csv += toText(t) + ',' + toText(std::round(force)) + ',' + toText(height) + '\n';
  }
  directory_.put("field.csv", csv);
  directory_.put("field.yaml", "source: lab\ntare_n: 0\nrig: rig.yaml\n");
  directory_.put("rig.yaml", std::string(kScenario) + "title2: x\n");
  EXPECT_EQ(program("replay field.csv --out out").exit_code, 2) << "unknown key in rig";
  directory_.put("rig.yaml",
                 "field: {length_x_m: 3.0, length_y_m: 3.0, thickness_m: 0.6}\ncollector: {radius_m: 0.6}\n"
                 "procedure: {start: folded_above_ice, settle_duration_s: 0.5}\nsolver: {threads: 1}\n");
  const Outcome replay = program("replay field.csv --out out --prepare-only");
  ASSERT_EQ(replay.exit_code, 0) << replay.text;
  EXPECT_TRUE(contains(replay.text, "lowering and unfolding are left out")) << replay.text;
  const CraneMotion motion = CraneMotion::read(directory_.file("out/motion.csv"));
  EXPECT_GE(motion.lowest(), -0.06);
  EXPECT_NEAR(motion.highest(), 1.0, 0.06);
  EXPECT_FALSE(std::filesystem::exists(directory_.file("out/force.csv"))) << "only prepared";
  const Outcome check = program("check out/replay.yaml");
  EXPECT_EQ(check.exit_code, 0) << check.text;
}

TEST_F(ReplayProgram, WrongRecordIsRefusedWithItsReason) {
  directory_.put("still.csv", "time_s,force_n,hoist_position_m\n0,1,2\n1,1,2\n");
  directory_.put("still.yaml", "source: field\n");
  const Outcome still = program("replay still.csv --out out");
  EXPECT_EQ(still.exit_code, 2);
  EXPECT_TRUE(contains(still.text, "still.csv: this record cannot be replayed; ")) << still.text;
  EXPECT_TRUE(contains(still.text, "too_few_samples: ")) << still.text;
  directory_.put("still.yaml", "source: synthetic\ncommands: gone.csv\n");
  EXPECT_TRUE(contains(program("replay still.csv --out out").text, "must name a file that exists"));
  directory_.put("gone.csv", "time_s,velocity_z_mps\n0,0.1\n1,\n");
  EXPECT_TRUE(contains(program("replay still.csv --out out").text, "needs procedure.control: manual"));
  EXPECT_EQ(program("replay").exit_code, 2);
  EXPECT_TRUE(contains(program("replay ''").text, "names no record"));
  EXPECT_NE(program("run small.yaml --out run --record /proc/none/x").exit_code, 0);
}

}  // namespace
}  // namespace brash_ice_rig
