#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <geometry_msgs/WrenchStamped.h>
#include <rosgraph_msgs/Clock.h>
#include <sys/stat.h>
#include <unistd.h>

#include "brash_ice_rig/Checkpoint.h"
#include "brash_ice_rig/system/child_process.h"
#include "test_support.h"

namespace brash_ice_rig {
namespace {

namespace fs = std::filesystem;

std::string readFile(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// The value behind a key of summary.json, as it stands there.
std::string summaryValue(const fs::path& file, const std::string& key) {
  const std::string text = readFile(file), head = "\"" + key + "\": ";
  const std::size_t begin = text.find(head);
  if (begin == std::string::npos) return "";
  return text.substr(begin + head.size(), text.find('\n', begin) - begin - head.size());
}

/// Nodes that start paused, and what they leave.
class NodeCheckpoint : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(scratch_); }
  void TearDown() override {
    node_.reset();
    fs::remove_all(scratch_);
  }

  void start(const std::string& output, const std::vector<std::string>& parameters = {}) {
    node_.reset();
    ChildSetup setup;
    setup.program = RIG_NODE;
    setup.log_file = (scratch_ / "log.txt").string();
    // A name for each: the master remembers the services of a node that was killed.
    static int count = 0;
    name_ = "rig_" + std::to_string(++count);
    setup.arguments = {"__name:=" + name_,
                       "_scenario:=" BRASH_ICE_SOURCE_DIR "/test/ros/small.yaml",
                       "_start_paused:=true",
                       "_exit_at_end:=false",
                       "_settings:=load_cell.noise_n=15",
                       "_checkpoint_every_s:=0.0",
                       "_checkpoint_dir:=" + checkpoints().string(),
                       "_output_dir:=" + (scratch_ / output).string()};
    setup.arguments.insert(setup.arguments.end(), parameters.begin(), parameters.end());
    node_ = std::make_unique<ChildProcess>(setup);
    ASSERT_TRUE(ros::service::waitForService(name_ + "/load_checkpoint", 15000)) << readFile(setup.log_file);
  }

  /// @return how the node ended
  std::string end(int signal) {
    node_->sendSignal(signal);
    const auto ended = node_->wait(std::chrono::seconds(20));
    node_.reset();
    return ended ? ended->text() : "it runs on";
  }

  void step(double duration_s) const {
    const auto answer = callStep(name_ + "/step", duration_s);
    ASSERT_TRUE(answer.success) << answer.message;
  }

  Checkpoint::Response call(const std::string& service, const std::string& file) const {
    Checkpoint request;
    request.request.file = file;
    callWhenOffered(name_ + "/" + service, request);
    return request.response;
  }
  std::string refusal(const std::string& service, const std::string& file) const {
    const auto answer = call(service, file);
    EXPECT_FALSE(answer.success) << service << " " << file;
    return answer.message;
  }

  fs::path checkpoints() const { return scratch_ / "checkpoints"; }

  const fs::path scratch_ = fs::temp_directory_path() / ("brash_ice_rig_checkpoint_" + std::to_string(getpid()));
  std::unique_ptr<ChildProcess> node_;
  std::string name_;
};

TEST_F(NodeCheckpoint, AfterKillMinus9ReadingsAreThoseOfTheUninterruptedRun) {
  // 1 s of settling and 4 s of lift.
  Listener<geometry_msgs::WrenchStamped> wrench("load_cell/wrench");
  start("whole");
  ASSERT_TRUE(wrench.waitForConnection());
  step(5.05);
  ASSERT_TRUE(waitFor([&] { return wrench.messages.size() == 505; })) << wrench.messages.size();
  const auto whole = wrench.messages;
  EXPECT_EQ(end(SIGINT), "exit code 0");

  start("killed");
  step(2.505);  // not a whole number of samples
  const auto saved = call("save_checkpoint", "middle.bin");
  ASSERT_TRUE(saved.success) << saved.message;
  EXPECT_EQ(saved.message, "saved time 1.505 s as " + (checkpoints() / "middle.bin").string());
  step(0.7);
  end(SIGKILL);

  start("killed");
  spinFor(0.5);
  wrench.messages.clear();
  ASSERT_TRUE(wrench.waitForConnection());
  const auto loaded = call("load_checkpoint", "middle.bin");
  ASSERT_TRUE(loaded.success) << loaded.message;
  EXPECT_EQ(loaded.message, "goes on from time 1.505 s, paused");
  step(5.05 - 2.505);
  ASSERT_TRUE(waitFor([&] { return wrench.messages.size() == 255; })) << wrench.messages.size();
  for (std::size_t k = 0; k < wrench.messages.size(); ++k) {
    ASSERT_EQ(wrench.messages[k].wrench.force.z, whole[250 + k].wrench.force.z) << "sample " << k;
  }
  end(SIGINT);
  for (const char* name : {"force.csv", "plug.csv"}) {
    EXPECT_EQ(readFile(scratch_ / "killed/run_2" / name), readFile(scratch_ / "whole" / name)) << name;
  }
  for (const char* key : {"peak_force_n", "residual_force_n", "step_count", "status"}) {
    EXPECT_NE(summaryValue(scratch_ / "whole/summary.json", key), "") << key;
    EXPECT_EQ(summaryValue(scratch_ / "killed/run_2/summary.json", key),
              summaryValue(scratch_ / "whole/summary.json", key))
        << key;
  }
}

TEST_F(NodeCheckpoint, AutosaveIsWhatRemainsOfANodeThatWasKilled) {
  start("run", {"_checkpoint_every_s:=0.5"});
  const fs::path file = checkpoints() / "checkpoint.bin";
  step(0.51);
  ASSERT_TRUE(waitFor([&] { return fs::exists(file); })) << "nothing was saved at -0.5 s";
  const std::string first = readFile(file);
  step(0.8);
  ASSERT_TRUE(waitFor([&] { return readFile(file) != first; })) << "nothing was saved at 0 s";
  step(0.1);
  end(SIGKILL);
  start("run");
  const auto loaded = call("load_checkpoint", "");
  EXPECT_TRUE(loaded.success) << loaded.message;
  EXPECT_EQ(loaded.message, "goes on from time 0 s, paused");
}

TEST_F(NodeCheckpoint, TimeGoesOnOverALoadAndTheTestGoesBack) {
  Listener<rosgraph_msgs::Clock> clock("/clock");
  Listener<SimStatus> status("sim/status");
  start("run");
  ASSERT_TRUE(status.waitForConnection());
  step(1.2);
  ASSERT_TRUE(call("save_checkpoint", "").success);
  step(0.8);
  ASSERT_TRUE(status.waitForNew([](const SimStatus& s) { return s.time_s > 0.9; }));
  clock.messages.clear();
  ASSERT_TRUE(call("load_checkpoint", "").success);
  ASSERT_TRUE(status.waitForNew([](const SimStatus& s) { return s.time_s < 0.9; }));
  EXPECT_NEAR(status.last().time_s, 0.2, 1e-9);
  EXPECT_EQ(status.last().stage, "lift");
  EXPECT_TRUE(status.last().paused);
  step(0.2);
  ASSERT_TRUE(clock.waitForNew());
  for (std::size_t k = 1; k < clock.messages.size(); ++k) {
    ASSERT_GE(clock.messages[k].clock, clock.messages[k - 1].clock);
  }
  // What a service may name: files in the directory, by plain names.
  for (const char* file : {"../outside.bin", "/tmp/outside.bin", "sub/file.bin", "..", ".hidden", "new\nline"}) {
    for (const char* service : {"save_checkpoint", "load_checkpoint"}) {
      EXPECT_NE(refusal(service, file).find("plain name"), std::string::npos) << file;
    }
  }
  EXPECT_NE(refusal("save_checkpoint", std::string(5000, 'x')).find("plain name"), std::string::npos);
  EXPECT_EQ(std::distance(fs::directory_iterator(checkpoints()), {}), 1) << "a refused name left a file";

  // What is not good leaves the rig as it is.
  ASSERT_TRUE(status.waitForNew([](const SimStatus& s) { return s.time_s > 0.3; }));
  const double before_s = status.last().time_s;
  EXPECT_NE(refusal("load_checkpoint", "nowhere.bin").find("nowhere.bin: file cannot be read"), std::string::npos);
  std::string content = readFile(checkpoints() / "checkpoint.bin");
  std::ofstream(checkpoints() / "short.bin", std::ios::binary) << content.substr(0, content.size() / 2);
  EXPECT_NE(refusal("load_checkpoint", "short.bin").find("short.bin: is damaged"), std::string::npos);
  content[content.size() / 3] = static_cast<char>(content[content.size() / 3] ^ 1);
  std::ofstream(checkpoints() / "flipped.bin", std::ios::binary) << content;
  EXPECT_NE(refusal("load_checkpoint", "flipped.bin").find("flipped.bin: is damaged"), std::string::npos);
  fs::create_symlink(checkpoints() / "checkpoint.bin", checkpoints() / "link.bin");
  fs::create_symlink(scratch_ / "outside.bin", checkpoints() / "dangling.bin");
  for (const char* file : {"link.bin", "dangling.bin"}) {
    for (const char* service : {"save_checkpoint", "load_checkpoint"}) {
      EXPECT_NE(refusal(service, file).find("is a link"), std::string::npos) << file;
    }
  }
  EXPECT_FALSE(fs::exists(scratch_ / "outside.bin"));
  ASSERT_EQ(mkfifo((checkpoints() / "pipe.bin").c_str(), 0600), 0);
  EXPECT_NE(refusal("load_checkpoint", "pipe.bin").find("is not a file"), std::string::npos);
  ASSERT_TRUE(status.waitForNew());
  EXPECT_NEAR(status.last().time_s, before_s, 1e-9);
  end(SIGINT);

  // Another rig.
  start("run", {"_settings:=ice.cohesion_pa=999"});
  EXPECT_NE(refusal("load_checkpoint", "").find("is of another scenario: ice.cohesion_pa = "), std::string::npos);
}

TEST_F(NodeCheckpoint, AutosaveThatFailsSaysSoAndTheRigGoesOn) {
  std::ofstream(checkpoints()) << "in the way of the directory";
  start("run", {"_checkpoint_every_s:=0.5"});
  step(1.2);
  EXPECT_NE(refusal("save_checkpoint", "").find(checkpoints().string() + ": "), std::string::npos);
  step(0.2);
  EXPECT_EQ(end(SIGINT), "exit code 1");
  EXPECT_NE(readFile(scratch_ / "log.txt").find("the rig goes on without this checkpoint"), std::string::npos);
}

TEST_F(NodeCheckpoint, WithoutADirectoryNothingIsWrittenOrRead) {
  start("run", {"_checkpoint_dir:="});
  EXPECT_EQ(refusal("save_checkpoint", "a.bin"), "the parameter ~checkpoint_dir does not say where");
  EXPECT_EQ(refusal("load_checkpoint", "a.bin"), "the parameter ~checkpoint_dir does not say where");
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "checkpoint_test");
}
