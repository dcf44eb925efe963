// Drives `brash_ice check` with records as a test engineer does.

#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "../output/shell.h"
#include "../output/temporary_directory.h"

namespace brash_ice_rig {
namespace {

class RecordProgram : public ::testing::Test {
 protected:
  Outcome program(const std::string& arguments) const {
    return runShell("cd '" + directory_.path() + "' && '" BRASH_ICE_PROGRAM "' " + arguments);
  }

  TemporaryDirectory directory_;
};

TEST_F(RecordProgram, ForceCurveOfARunIsAGoodRecord) {
  directory_.put(
      "small.yaml",
      "title: Small field\n"
      "field: {length_x_m: 3.0, length_y_m: 3.0, thickness_m: 0.6}\n"
      "collector: {radius_m: 0.6}\n"
      "load_cell: {noise_n: 20.0, resolution_n: 5.0}\n"
      "procedure: {settle_duration_s: 6.0, lift_speed_mps: 0.2, lift_duration_s: 6.0, hold_duration_s: 2.0}\n"
      "solver: {threads: 1}\n");
  const Outcome run = program("run small.yaml --out run");
  ASSERT_EQ(run.exit_code, 0) << run.text;
  // The empty rig weighs 240 kg; collector and pole displace 0.02 m³ and some more.
  directory_.put("run/force.yaml", "source: synthetic\ntare_n: 2100\nrig: scenario.yaml\nice: {thickness_m: 0.6}\n");
  const Outcome check = program("check run run/force.csv run/force.yaml run/force run/scenario.yaml small.yaml");
  EXPECT_EQ(check.exit_code, 0) << check.text;
  for (const char* part : {"run: record \"force\" (synthetic)", "100 Hz", "steps of 5 N", "quiet -5.99 to",
                           "run/force.csv: record", "run/force.yaml: record", "run/force: record",
                           "run/scenario.yaml: ok", "small.yaml: ok", "usable for identification: yes"}) {
    EXPECT_TRUE(contains(check.text, part)) << part << "\n" << check.text;
  }
  EXPECT_FALSE(contains(check.text, "limit")) << check.text;

  // The same without its load cell's sign.
  const Outcome awk =
      runShell("cd '" + directory_.path() + "' && awk -F, -v OFS=, 'NR > 1 { $2 = -$2 } 1' run/force.csv > wrong.csv");
  ASSERT_EQ(awk.exit_code, 0) << awk.text;
  directory_.put("wrong.yaml", "source: synthetic\ntare_n: -2100\nrig: run/scenario.yaml\n");
  const Outcome wrong = program("check wrong.csv");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_TRUE(contains(wrong.text, "refused   sign: line ")) << wrong.text;
  EXPECT_TRUE(contains(wrong.text, "usable for identification: no")) << wrong.text;
}

TEST_F(RecordProgram, GarbageIsRefusedAndTheRestIsCheckedAllTheSame) {
  directory_.put("small.yaml", "title: fine\n");
  directory_.put("binary.csv", std::string("\x7F\x45\x4C\x46\0\0\1\2", 8));
  directory_.put("binary.yaml", "source: field\n");
  directory_.put("header.csv", "time_s,force_n,hoist_position_m\n");
  directory_.put("header.yaml", "source: field\n");
  directory_.put("alone.csv", "time_s,force_n,hoist_position_m\n0,1,2\n");
  directory_.put("fake.bag", "#ROSBAG V2.0\nnothing follows");
  std::filesystem::create_directory(directory_.file("empty"));
  const Outcome outcome = program("check binary.csv header.csv alone.csv fake.bag empty nowhere.csv small.yaml");
  EXPECT_EQ(outcome.exit_code, 2);
  for (const char* part :
       {"binary.csv:1: not text", "header.csv: has a header, but no rows", "alone.yaml: the manifest is missing",
        "fake.bag: this bag could not be made a record: ", "empty: holds no record", "nowhere.csv", "small.yaml: ok"}) {
    EXPECT_TRUE(contains(outcome.text, part)) << part << "\n" << outcome.text;
  }
}

TEST_F(RecordProgram, HugeFilesAreRefusedBeforeTheyAreRead) {
  // Sparse: a gigabyte of zero bytes; and without an end, but for the limit.
  for (const char* name : {"huge.csv", "huge.yaml", "huge"}) {
    std::ofstream(directory_.file(name)) << (std::string(name) == "huge.csv" ? "time_s,force_n,hoist_speed_mps\n"
                                                                             : "x");
    std::filesystem::resize_file(directory_.file(name), 1u << 30);
  }
  EXPECT_TRUE(contains(program("check huge.csv").text, "huge.csv:2: not text: byte 0"));
  EXPECT_TRUE(contains(program("check huge.yaml").text, "huge.yaml: is larger than 4 MB"));
  EXPECT_TRUE(contains(program("check huge").text, "huge: is larger than 4 MB"));
  directory_.put("long.yaml", "source: field\n");
  const Outcome lines = runShell("cd '" + directory_.path() +
                                 "' && (echo time_s,force_n,hoist_speed_mps; yes 1,2,3 | head -n 1000001) > " +
                                 "long.csv && '" BRASH_ICE_PROGRAM "' check long.csv");
  EXPECT_EQ(lines.exit_code, 2);
  EXPECT_TRUE(contains(lines.text, "long.csv: more than 1000000 lines")) << lines.text;
}

}  // namespace
}  // namespace brash_ice_rig
