// Records a test that is driven by hand, replays it, and compares.

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <geometry_msgs/TwistStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <std_msgs/Float64.h>

#include "brash_ice_rig/CraneState.h"
#include "brash_ice_rig/ForceResidual.h"
#include "brash_ice_rig/TakenCommand.h"
#include "test_support.h"

namespace brash_ice_rig {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> linesOf(const fs::path& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

std::string textOf(const fs::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// roslaunch with its output in a file.
class Launch {
 public:
  Launch(const std::string& arguments, const fs::path& log) {
    const std::string command =
        "exec timeout 100 roslaunch " BRASH_ICE_SOURCE_DIR "/launch/" + arguments + " > " + log.string() + " 2>&1";
    char shell[] = "/bin/sh", option[] = "-c";
    std::string text = command;
    char* const argv[] = {shell, option, text.data(), nullptr};
    EXPECT_EQ(posix_spawn(&child_, shell, nullptr, nullptr, argv, environ), 0);
  }
  ~Launch() {
    if (child_ != 0) interrupt();
  }

  int wait() {
    int status = 0;
    // The test's own subscribers want their messages meanwhile.
    while (waitpid(child_, &status, WNOHANG) == 0) spinFor(0.02);
    child_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  int interrupt() {
    kill(child_, SIGINT);
    return wait();
  }

 private:
  pid_t child_ = 0;
};

class ReplayLaunch : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(scratch_); }
  void TearDown() override { fs::remove_all(scratch_); }

  int replay(const std::string& arguments) {
    return Launch("replay.launch headless:=true " + arguments, scratch_ / "log.txt").wait();
  }
  std::string log() const { return textOf(scratch_ / "log.txt"); }
  std::string path(const std::string& name) const { return (scratch_ / name).string(); }

  fs::path scratch_ = fs::temp_directory_path() / ("brash_ice_rig_replay_test_" + std::to_string(getpid()));
};

geometry_msgs::TwistStamped velocity(double x_mps, double z_mps) {
  geometry_msgs::TwistStamped command;
  command.twist.linear.x = x_mps;
  command.twist.linear.z = z_mps;
  return command;
}

TEST_F(ReplayLaunch, ReplayOfATestByHandReproducesItsForceBitForBit) {
  std::string bag;
  {
    Launch launch("pull_up.launch rviz:=false teleop:=true record:=true paused:=true scenario:=" BRASH_ICE_SOURCE_DIR
                  "/test/ros/small.yaml settings:='load_cell.noise_n=15;load_cell.lag_s=0.1' output_dir:=" +
                      path("run") + " bag:=" + path("bag"),
                  scratch_ / "log.txt");
    ros::NodeHandle node;
    auto crane_command = node.advertise<geometry_msgs::TwistStamped>("/rig/crane/cmd_vel", 1);
    auto fold_command = node.advertise<std_msgs::Float64>("/rig/collector/cmd_fold", 1);
    Listener<CraneState> crane("/rig/crane/state");
    Listener<TakenCommand> taken("/rig/sim/commands");
    // The node and the recorder, and only then time goes on.
    ASSERT_TRUE(
        waitFor([&] { return crane_command.getNumSubscribers() >= 2 && fold_command.getNumSubscribers() >= 2; }, 40.0))
        << log();
    spinFor(1.0);
    ASSERT_TRUE(callTrigger("/rig/rig_node/resume").success);
    const auto drive = [&](const geometry_msgs::TwistStamped& command, double until_s) {
      while (crane.messages.empty() || crane.last().time_s < until_s) {
        crane_command.publish(command);
        spinFor(0.05);
      }
    };
    drive(velocity(0.0, 0.0), 0.2);
    ASSERT_TRUE(callTrigger("/rig/load_cell/tare").success);
    drive(velocity(0.02, 0.15), 1.5);
    std_msgs::Float64 fold;
    fold.data = 0.97;
    fold_command.publish(fold);
    spinFor(0.6);  // silence: the watchdog stops the crane
    drive(velocity(-0.01, 0.3), 3.0);
    ASSERT_GT(taken.messages.size(), 20u);
    EXPECT_EQ(launch.interrupt(), 0) << log();
  }
  for (const auto& entry : fs::directory_iterator(scratch_)) {
    if (entry.path().extension() == ".bag") bag = entry.path().string();
  }
  ASSERT_FALSE(bag.empty()) << log();

  Listener<geometry_msgs::WrenchStamped> measured("/rig/measured/wrench"), simulated("/rig/load_cell/wrench");
  Listener<ForceResidual> residual("/rig/measured/residual");
  ASSERT_EQ(replay("bag:=" + bag + " real_time_factor:=2 output_dir:=" + path("again")), 0) << log();
  EXPECT_NE(log().find("command_timeout"), std::string::npos) << "the watchdog's stop is repeated, too: " << log();

  // Every column of every row: time, force, height, stage, components, in digits that give back the bits.
  const std::vector<std::string> first = linesOf(path("run") + "/force.csv"),
                                 second = linesOf(path("again") + "/force.csv");
  ASSERT_GT(first.size(), 350u);
  ASSERT_GE(second.size(), first.size() - 100) << log();
  // The bag may end some samples before the file does.
  const std::size_t common = std::min(first.size(), second.size() - 1);
  for (std::size_t i = 0; i < common; ++i) ASSERT_EQ(second[i], first[i]) << "row " << i;

  // Side by side: the measured one has the stamp and the bits of the simulated one.
  std::map<ros::Time, double> at;
  for (const auto& wrench : simulated.messages) at[wrench.header.stamp] = wrench.wrench.force.z;
  std::size_t pairs = 0;
  for (const auto& wrench : measured.messages) {
    if (at.count(wrench.header.stamp) == 0) continue;
    ++pairs;
    ASSERT_EQ(wrench.wrench.force.z, at[wrench.header.stamp]);
    EXPECT_EQ(wrench.header.frame_id, "load_cell");
  }
  EXPECT_GT(pairs, 100u);
  for (const auto& message : residual.messages) EXPECT_FALSE(message.significant) << message.text;
}

TEST_F(ReplayLaunch, CsvOfAForeignTestMovesTheHoistAsMeasured) {
  // A rest of 3 s, then up in two goes; nobody's simulation.
  std::ofstream csv(path("field.csv"));
  csv << "time_s,force_n,hoist_position_m\n";
  const auto height = [](double t) {
    return -1.5 + 0.15 * std::clamp(t - 103.0, 0.0, 4.0) + 0.1 * std::clamp(t - 108.0, 0.0, 5.0);
  };
  for (int i = 0; i <= 700; ++i) {
    const double t = 100.0 + 0.02 * i;
    csv << t << ',' << std::round(5000.0 * std::clamp((t - 103.0) / 4.0, 0.0, 1.0) + 20.0 * std::sin(7.0 * i)) << ','
        << height(t) << '\n';
  }
  csv.close();
  std::ofstream(path("field.yaml")) << "source: lab\ntare_n: 0\nrig: " BRASH_ICE_SOURCE_DIR "/test/ros/small.yaml\n";
  Listener<geometry_msgs::WrenchStamped> measured("/rig/measured/wrench");
  Listener<ForceResidual> residual("/rig/measured/residual");
  ASSERT_EQ(replay("csv:=" + path("field.csv") + " real_time_factor:=3 output_dir:=" + path("out")), 0) << log();
  std::size_t compared = 0;
  for (const std::string& line : linesOf(path("out") + "/force.csv")) {
    double time = 0.0, force = 0.0, hub = 0.0;
    if (std::sscanf(line.c_str(), "%lf,%lf,%lf", &time, &force, &hub) != 3 || time < 0.5) continue;
    // The hub starts where the scenario says; the ramps of the hoist round the corners.
    EXPECT_NEAR(hub - (-1.08 - 0.3 - 0.1), height(100.0 + time) + 1.5, 0.035) << time;
    ++compared;
  }
  EXPECT_GT(compared, 1200u);
  EXPECT_GT(measured.messages.size(), 500u);
  ASSERT_FALSE(residual.messages.empty());
}

TEST_F(ReplayLaunch, WrongFilesAreRefusedBeforeAnythingStarts) {
  std::ofstream(path("garbage.bag")) << "#ROSBAG V2.0\nnothing follows";
  std::ofstream(path("alone.csv")) << "time_s,force_n,hoist_position_m\n0,1,2\n";
  std::ofstream(path("still.csv")) << "time_s,force_n,hoist_position_m\n0,1,2\n1,1,2\n";
  std::ofstream(path("still.yaml")) << "source: field\n";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"record:=" + path("nowhere.csv"), "nowhere.csv"},
      {"bag:=" + path("garbage.bag"), "this bag could not be made a record"},
      {"csv:=" + path("alone.csv"), "alone.yaml: the manifest is missing"},
      {"csv:=" + path("still.csv"), "this record cannot be replayed"},
  };
  for (const auto& [arguments, message] : cases) {
    EXPECT_NE(replay(arguments + " output_dir:=" + path("out")), 0) << arguments;
    EXPECT_NE(log().find(message), std::string::npos) << arguments << "\n" << log();
    EXPECT_EQ(log().find("process[rig/"), std::string::npos) << "a node was started: " << log();
  }
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "replay_test");
}
