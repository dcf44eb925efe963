#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <sys/wait.h>
#include <unistd.h>

#include "test_support.h"

namespace brash_ice_rig {
namespace {

namespace fs = std::filesystem;

const fs::path kScratch = fs::temp_directory_path() / ("brash_ice_rig_launch_test_" + std::to_string(getpid()));

std::string readFile(const fs::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

class PullUpLaunch : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(kScratch); }
  void TearDown() override { fs::remove_all(kScratch); }

  /// @return exit code of roslaunch
  static int launch(const std::string& arguments) {
    const std::string command = "timeout 100 roslaunch " BRASH_ICE_SOURCE_DIR
                                "/launch/pull_up.launch scenario:=" BRASH_ICE_SOURCE_DIR "/test/ros/small.yaml " +
                                arguments + " > " + (kScratch / "log.txt").string() + " 2>&1";
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  static std::string log() { return readFile(kScratch / "log.txt"); }
};

TEST_F(PullUpLaunch, HeadlessRunEndsByItselfAndLeavesItsFiles) {
  const fs::path out = kScratch / "out";
  // In real time: as fast as it can, the test would be over before the recorder has found its topics.
  EXPECT_EQ(launch("headless:=true record:=true real_time_factor:=1 output_dir:=" + out.string() +
                   " bag:=" + (kScratch / "bag").string()),
            0)
      << log();
  for (const char* name : {"force.csv", "scenario.yaml", "summary.json", "force.png"}) {
    EXPECT_TRUE(fs::exists(out / name)) << name << "\n" << log();
    EXPECT_NE(log().find((out / name).string()), std::string::npos) << "its path is printed";
  }
  EXPECT_NE(log().find("lift    t    2.0 s"), std::string::npos) << log();
  EXPECT_NE(readFile(out / "summary.json").find("\"status\": \"ok\""), std::string::npos)
      << readFile(out / "summary.json");
  // 1 s of settling and 4 s of lift at 100 Hz, and the header.
  const std::string rows = readFile(out / "force.csv");
  EXPECT_NEAR(static_cast<double>(std::count(rows.begin(), rows.end(), '\n')), 502.0, 3.0);
  std::string bag;
  for (const auto& entry : fs::directory_iterator(kScratch)) {
    if (entry.path().extension() == ".bag") bag = readFile(entry.path());
  }
  EXPECT_GT(bag.size(), 100000u) << log();
  // A bag keeps each topic's name in plain text: the whole one, or playing it would not reach who listens to the rig.
  for (const char* topic : {"load_cell/wrench", "ice/points", "crane/state", "sim/scenario"}) {
    EXPECT_NE(bag.find(std::string("topic=/rig/") + topic), std::string::npos) << topic;
  }
}

TEST_F(PullUpLaunch, BadScenarioIsRefusedWithItsKey) {
  EXPECT_NE(launch("headless:=true settings:=field.spacing_m=-1 output_dir:=" + (kScratch / "out").string()), 0);
  EXPECT_NE(log().find("field.spacing_m"), std::string::npos) << log();
  EXPECT_FALSE(fs::exists(kScratch / "out"));
}

TEST_F(PullUpLaunch, EveryArgumentIsExplained) {
  const std::string text = readFile(BRASH_ICE_SOURCE_DIR "/launch/pull_up.launch");
  std::size_t arguments = 0;
  for (std::size_t at = text.find("<arg name="); at != std::string::npos; at = text.find("<arg name=", at + 1)) {
    if (at > text.find("<group")) break;
    const std::string tag = text.substr(at, text.find("/>", at) - at);
    EXPECT_NE(tag.find("doc="), std::string::npos) << tag;
    ++arguments;
  }
  EXPECT_GE(arguments, 15u);
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "pull_up_launch_test");
}
