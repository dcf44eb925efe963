#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <future>
#include <string>

#include <sys/wait.h>
#include <unistd.h>

#include "test_support.h"

namespace brash_ice_rig {
namespace {

const std::string kSmall = "_scenario:=" BRASH_ICE_SOURCE_DIR "/test/ros/small.yaml";

struct BadInput {
  const char* name;
  std::string arguments;  ///< of rig_node
  std::string key;        ///< must be named
  std::string rule;       ///< must be stated
};

void PrintTo(const BadInput& input, std::ostream* out) {
  *out << input.name;
}

struct Outcome {
  int exit_code = -1;
  std::string text;
};

Outcome runCommand(const std::string& command) {
  Outcome outcome;
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  std::array<char, 512> line;
  while (std::fgets(line.data(), line.size(), pipe) != nullptr) outcome.text += line.data();
  const int status = pclose(pipe);
  if (WIFEXITED(status)) outcome.exit_code = WEXITSTATUS(status);
  return outcome;
}

class NodeInput : public testing::TestWithParam<BadInput> {};

TEST_P(NodeInput, EndsTheNodeWithCode2AndNamesKeyAndRule) {
  // A name for each: parameters stay on the server.
  const Outcome outcome =
      runCommand("timeout 20 " RIG_NODE " __name:=rig_" + std::string(GetParam().name) + " " + GetParam().arguments);
  EXPECT_EQ(outcome.exit_code, 2) << outcome.text;
  EXPECT_NE(outcome.text.find("FATAL"), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find(GetParam().key), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find(GetParam().rule), std::string::npos) << outcome.text;
}

INSTANTIATE_TEST_SUITE_P(
    BadInput, NodeInput,
    testing::Values(
        BadInput{"no_scenario", "", "/scenario", "must name a scenario file"},
        BadInput{"missing_file", "_scenario:=/nonexistent.yaml", "/nonexistent.yaml", ""},
        BadInput{"negative_factor", kSmall + " _real_time_factor:=-1", "real_time_factor", "must be a number in"},
        BadInput{"factor_is_text", kSmall + " _real_time_factor:=fast", "real_time_factor", "must be a number in"},
        BadInput{"factor_is_nan", kSmall + " _real_time_factor:=nan", "real_time_factor", "must be a number in"},
        BadInput{"paused_is_number", kSmall + " _start_paused:=7", "start_paused", "must be true or false"},
        BadInput{"zero_rate", kSmall + " _points_rate_hz:=0", "points_rate_hz", "must be a number in"},
        BadInput{"misspelt", kSmall + " _real_time_facter:=1", "real_time_facter", "unknown parameter; known are:"},
        BadInput{"slash_prefix", kSmall + " _frame_prefix:=/rig", "frame_prefix", "must not begin with a slash"},
        BadInput{"working_dir", kSmall + " _working_dir:=/nonexistent", "working_dir", "must be a directory"},
        BadInput{"output_dir", kSmall + " _output_dir:=/dev/null/run", "/dev/null/run", ""},
        BadInput{"checkpoint_name", kSmall + " _checkpoint_file:=../a.bin", "checkpoint_file",
                 "must be the plain name"},
        BadInput{"checkpoint_often", kSmall + " _checkpoint_dir:=/tmp _checkpoint_every_s:=-1", "checkpoint_every_s",
                 "must be a number in"},
        BadInput{"checkpoint_nowhere", kSmall + " _checkpoint_every_s:=10", "checkpoint_every_s",
                 "needs ~checkpoint_dir"},
        BadInput{"setting_out_of_range", kSmall + " _settings:=field.spacing_m=-1", "field.spacing_m", "must"},
        BadInput{"unknown_setting", kSmall + " _settings:=field.spaceing_m=1", "field.spaceing_m", "field.spacing_m"},
        BadInput{"missing_overlay", kSmall + " _overlays:=/nonexistent.yaml", "/nonexistent.yaml", ""}),
    [](const testing::TestParamInfo<BadInput>& info) { return std::string(info.param.name); });

TEST(UrdfInput, BadScenarioEndsTheProgramWithCode2) {
  const Outcome outcome = runCommand(RIG_URDF " /nonexistent.yaml '' '' ''");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_NE(outcome.text.find("/nonexistent.yaml"), std::string::npos) << outcome.text;
}

/// A node that writes into a directory of its own and is interrupted after 6 s.
class LostFiles : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::future<Outcome> startNode(const std::string& name, const std::string& more = "") const {
    return std::async(std::launch::async, runCommand,
                      "timeout --preserve-status -s INT 6 " RIG_NODE " __name:=" + name + " " + kSmall +
                          " _output_dir:=" + directory_.string() + more);
  }

  const std::filesystem::path directory_ =
      std::filesystem::temp_directory_path() / ("brash_ice_rig_lost_files_" + std::to_string(getpid()));
};

TEST_F(LostFiles, ResetThatCannotRecordStillResetsAndSaysSo) {
  std::filesystem::create_directories(directory_);
  std::ofstream(directory_ / "run_2") << "in the way";
  auto node = startNode("blocked");
  const auto answer = callTrigger("blocked/reset");
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_NE(answer.message.find("run_2"), std::string::npos) << answer.message;
  EXPECT_EQ(node.get().exit_code, 1);
}

TEST_F(LostFiles, ResetDoesNotWaitForThePlotOfTheRunBefore) {
  // A plot is of what comes after settling, and each run has some of it however fast one reset follows another.
  auto node = startNode("plotting", " _settings:=procedure.settle_duration_s=0 _start_paused:=true");
  ASSERT_TRUE(ros::service::waitForService("plotting/reset", 15000));
  for (int k = 0; k < 4; ++k) {
    EXPECT_TRUE(callStep("plotting/step", 0.05).success);
    EXPECT_TRUE(callTrigger("plotting/reset").success);
  }
  EXPECT_FALSE(std::filesystem::exists(directory_ / "run_3/force.png")) << "the last reset has waited for it";
  const std::string text = node.get().text;
  EXPECT_TRUE(std::filesystem::exists(directory_ / "run_4/force.png")) << "it is drawn all the same\n" << text;
}

TEST_F(LostFiles, InterruptedNodeNamesTheFileThatItCouldNotWrite) {
  auto node = startNode("lost");
  ASSERT_TRUE(ros::service::waitForService("lost/reset", 15000));
  std::filesystem::remove_all(directory_);
  const Outcome outcome = node.get();
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.text.find("summary.json: No such file"), std::string::npos) << outcome.text;
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "bad_input_test");
}
