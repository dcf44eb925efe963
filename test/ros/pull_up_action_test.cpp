#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/TwistStamped.h>
#include <sensor_msgs/JointState.h>

#include "brash_ice_rig/CraneState.h"
#include "brash_ice_rig/ForceComponents.h"
#include "brash_ice_rig/LoadScenario.h"
#include "brash_ice_rig/PullUpAction.h"
#include "brash_ice_rig/node/service_call.h"
#include "test_support.h"

namespace brash_ice_rig {
namespace {

using State = actionlib::SimpleClientGoalState;

/// From above the ice to below it and up into it: the ice is 1.2 m thick, the folded arms are 0.75 m long.
PullUpGoal fullGoal() {
  PullUpGoal goal;
  goal.depth_m = 2.0;
  goal.lower_speed_mps = 0.4;
  goal.unfold_before_lifting = true;
  goal.lift_speed_mps = 0.2;
  goal.lift_duration_s = 6.0;
  goal.hold_duration_s = 0.5;
  return goal;
}

/// Lifts the empty rig in the air.
PullUpGoal shortLift(double duration_s = 60.0) {
  PullUpGoal goal;
  goal.lift_speed_mps = 0.052;
  goal.lift_duration_s = duration_s;
  return goal;
}

bool stands(const sensor_msgs::JointState& joints) {
  return joints.velocity[2] == 0.0;
}

class Client {
 public:
  explicit Client(const std::string& name = "pull_up") : client_(name, false) {}

  bool connect() {
    return waitFor([this] { return client_.isServerConnected(); });
  }
  void send(const PullUpGoal& goal) {
    feedback.clear();
    client_.sendGoal(goal, {}, {}, [this](const PullUpFeedbackConstPtr& message) { feedback.push_back(*message); });
  }
  bool waitForStage(const std::string& stage) {
    return waitFor([&] { return !feedback.empty() && feedback.back().stage == stage; });
  }
  bool waitForEnd(double timeout_s = 30.0) {
    return waitFor([this] { return client_.getState().isDone(); }, timeout_s);
  }
  void cancel() { client_.cancelGoal(); }
  State::StateEnum state() const { return client_.getState().state_; }
  PullUpResult result() const { return client_.getResult() ? *client_.getResult() : PullUpResult(); }

  std::vector<PullUpFeedback> feedback;

 private:
  mutable actionlib::SimpleActionClient<PullUpAction> client_;
};

class PullUpByAction : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(callTrigger("rig_node/reset").success);
    ASSERT_TRUE(joints_.waitForConnection());
    ASSERT_TRUE(client_.connect());
    ASSERT_TRUE(crane_.waitForNew([](const CraneState& state) { return state.stage == "manual"; }));
  }

  /// The crane moves now, and stands 0.3 s of simulated time later.
  void expectStopWithinThreeTenths() {
    ASSERT_FALSE(stands(joints_.last()));
    const double from_s = joints_.last().header.stamp.toSec();
    ASSERT_TRUE(joints_.waitForNew(stands));
    const auto standing = std::find_if(
        joints_.messages.begin(), joints_.messages.end(),
        [&](const sensor_msgs::JointState& joints) { return joints.header.stamp.toSec() > from_s && stands(joints); });
    const double needed_s = standing->header.stamp.toSec() - from_s;
    EXPECT_LE(needed_s, 0.3);
    RecordProperty("stopped_after_ms", static_cast<int>(std::lround(1e3 * needed_s)));
  }

  bool lifting() {
    return joints_.waitForNew(
        [](const sensor_msgs::JointState& joints) { return std::abs(joints.velocity[2] - 0.052) < 1e-9; });
  }

  Listener<sensor_msgs::JointState> joints_{"joint_states"};
  Listener<CraneState> crane_{"crane/state"};
  Client client_;
};

TEST(PullUp, FullProcedureToSuccess) {
  Listener<ForceComponents> force("fast/ground_truth/force_components");
  Client client("fast/pull_up");
  ASSERT_TRUE(client.connect());
  ASSERT_TRUE(force.waitForConnection());
  ASSERT_TRUE(callTrigger("fast/rig_node/resume").success);
  client.send(fullGoal());
  ASSERT_TRUE(client.waitForEnd(60.0));
  EXPECT_TRUE(callTrigger("fast/rig_node/pause").success);
  const PullUpResult result = client.result();
  EXPECT_EQ(client.state(), State::SUCCEEDED) << result.message;
  EXPECT_TRUE(result.success);

  std::vector<std::string> stages;
  for (const auto& feedback : client.feedback) {
    if (stages.empty() || stages.back() != feedback.stage) stages.push_back(feedback.stage);
  }
  // A goal that comes before the field has settled waits for that.
  if (!stages.empty() && stages.front() == "settle") stages.erase(stages.begin());
  EXPECT_EQ(stages, (std::vector<std::string>{"lower", "unfold", "lift", "hold"}));
  const auto deepest =
      std::min_element(client.feedback.begin(), client.feedback.end(),
                       [](const auto& a, const auto& b) { return a.hoist_position_m < b.hoist_position_m; });
  EXPECT_NEAR(deepest->hoist_position_m, -2.0, 5e-3);

  // Peak and residual by their definitions, from the force that the node has published.
  const double first_s = client.feedback.front().time_s, last_s = first_s - 0.01 + result.duration_s;
  // The force comes on a connection of its own, and may come after the result.
  ASSERT_TRUE(waitFor([&] { return !force.messages.empty() && force.last().time_s > last_s - 0.005; }));
  std::vector<double> times_s, forces_n;
  for (const auto& sample : force.messages) {
    if (sample.time_s < first_s - 0.005 || sample.time_s > last_s + 0.005) continue;
    times_s.push_back(sample.time_s);
    forces_n.push_back(sample.tension_n);  // no sensor errors in this scenario
  }
  ASSERT_GT(forces_n.size(), 1000u);
  ASSERT_NEAR(times_s.back() - times_s.front(), 0.01 * static_cast<double>(times_s.size() - 1), 1e-3)
      << "samples have been lost on the way";
  const auto mean = [&](std::size_t from, std::size_t count) {
    double sum = 0.0;
    for (std::size_t i = from; i < from + count; ++i) sum += forces_n[i];
    return sum / static_cast<double>(count);
  };
  double peak_n = -1e9, peak_s = 0.0;
  for (std::size_t i = 0; i + 101 <= forces_n.size(); ++i) {
    if (mean(i, 101) > peak_n) {
      peak_n = mean(i, 101);
      peak_s = times_s[i + 50];
    }
  }
  EXPECT_NEAR(result.peak_force_n, peak_n, 1e-6 * peak_n);
  EXPECT_NEAR(result.peak_time_s, peak_s, 1e-6);
  EXPECT_NEAR(result.residual_force_n, mean(forces_n.size() - 450, 450), 1e-6 * peak_n);
  // Lower 2.2 m at 0.4 m/s, unfold 1 s, lift 6 s, hold 0.5 s, and the ramps.
  EXPECT_NEAR(result.duration_s, 2.2 / 0.4 + 1.0 + 6.0 + 0.5, 1.5);
  EXPECT_GT(result.peak_force_n, 190.0 * 9.81) << "more than the rig of 190 kg weighs out of the water";
}

TEST_F(PullUpByAction, CancelStopsTheCraneWithinThreeTenthsOfASecond) {
  client_.send(shortLift());
  ASSERT_TRUE(lifting());
  client_.cancel();
  expectStopWithinThreeTenths();
  ASSERT_TRUE(client_.waitForEnd());
  EXPECT_EQ(client_.state(), State::PREEMPTED);
  EXPECT_NE(client_.result().message.find("canceled, in stage lift"), std::string::npos) << client_.result().message;
  EXPECT_GT(client_.result().peak_force_n, 0.0);
}

/// Starts this program again as another node.
pid_t spawnRole(const std::string& role) {
  const char program[] = "/proc/self/exe";
  const char* const arguments[] = {program, role.c_str(), nullptr};
  pid_t child = 0;
  EXPECT_EQ(posix_spawn(&child, program, nullptr, nullptr, const_cast<char* const*>(arguments), environ), 0);
  return child;
}

TEST_F(PullUpByAction, KilledClientStopsTheCraneWithinThreeTenthsOfASecond) {
  const pid_t child = spawnRole("--client");
  ASSERT_TRUE(lifting());
  spinFor(0.1);
  kill(child, SIGKILL);
  expectStopWithinThreeTenths();
  waitpid(child, nullptr, 0);
  const double rest_m = joints_.last().position[2];
  ASSERT_TRUE(crane_.waitForNew());
  spinFor(0.3);
  EXPECT_EQ(joints_.last().position[2], rest_m);
  // The rig is free for the next one.
  client_.send(shortLift(0.5));
  ASSERT_TRUE(client_.waitForEnd());
  EXPECT_EQ(client_.state(), State::SUCCEEDED) << client_.result().message;
}

TEST_F(PullUpByAction, SenderThatDoesNotListenIsNotObeyedForLong) {
  Listener<PullUpActionResult> results("pull_up/result");
  ASSERT_TRUE(results.waitForConnection());
  const pid_t child = spawnRole("--deaf-sender");
  EXPECT_TRUE(results.waitForNew());
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  ASSERT_FALSE(results.messages.empty());
  EXPECT_NE(results.last().result.message.find("does not listen"), std::string::npos) << results.last().result.message;
  EXPECT_TRUE(joints_.waitForNew(stands));
}

TEST_F(PullUpByAction, ManualCommandTakesOver) {
  ros::NodeHandle node;
  auto publisher = node.advertise<geometry_msgs::TwistStamped>("crane/cmd_vel", 1);
  ASSERT_TRUE(waitFor([&] { return publisher.getNumSubscribers() > 0; }));
  client_.send(shortLift());
  ASSERT_TRUE(lifting());
  publisher.publish(geometry_msgs::TwistStamped());  // a single zero: stop
  expectStopWithinThreeTenths();
  ASSERT_TRUE(client_.waitForEnd());
  EXPECT_EQ(client_.state(), State::ABORTED);
  EXPECT_NE(client_.result().message.find("took over"), std::string::npos) << client_.result().message;
}

TEST_F(PullUpByAction, SecondGoalIsRejectedAndTheFirstGoesOn) {
  client_.send(shortLift(4.0));
  ASSERT_TRUE(lifting());
  Client second;
  ASSERT_TRUE(second.connect());
  second.send(shortLift());
  ASSERT_TRUE(second.waitForEnd());
  EXPECT_EQ(second.state(), State::REJECTED);
  EXPECT_NE(second.result().message.find("another goal"), std::string::npos) << second.result().message;
  ASSERT_TRUE(client_.waitForEnd());
  EXPECT_EQ(client_.state(), State::SUCCEEDED) << client_.result().message;
}

TEST_F(PullUpByAction, ScenarioIsNotReplacedUnderAGoalNorUnderAMovingCrane) {
  LoadScenario load;
  const auto answer = [&load] {
    callWhenOffered("rig_node/load_scenario", load);
    EXPECT_FALSE(load.response.success);
    return load.response.message;
  };
  client_.send(shortLift(4.0));
  ASSERT_TRUE(lifting());
  EXPECT_EQ(answer(), "the crane moves; let it stop first");
  client_.cancel();
  ASSERT_TRUE(client_.waitForEnd());
  PullUpGoal still = shortLift(0.1);
  still.hold_duration_s = 4.0;
  client_.send(still);
  ASSERT_TRUE(client_.waitForStage("hold"));
  ASSERT_TRUE(joints_.waitForNew(stands));
  EXPECT_EQ(answer(), "a goal of the action pull_up is running; cancel it first");
  ASSERT_TRUE(client_.waitForEnd());
  EXPECT_EQ(client_.state(), State::SUCCEEDED) << client_.result().message;
}

TEST_F(PullUpByAction, BadValueIsRejectedWithFieldValueAndRule) {
  PullUpGoal goal = fullGoal();
  goal.lift_speed_mps = 3.0;
  client_.send(goal);
  ASSERT_TRUE(client_.waitForEnd());
  EXPECT_EQ(client_.state(), State::REJECTED);
  EXPECT_EQ(client_.result().message, "lift_speed_mps = 3, must lie in (0, 0.5]");
  EXPECT_TRUE(std::isnan(client_.result().peak_force_n));
}

TEST_F(PullUpByAction, PauseHoldsItUpAndResetEndsIt) {
  client_.send(shortLift());
  ASSERT_TRUE(lifting());
  ASSERT_TRUE(callTrigger("rig_node/pause").success);
  spinFor(0.3);
  EXPECT_EQ(client_.state(), State::ACTIVE);
  ASSERT_TRUE(callTrigger("rig_node/resume").success);
  const std::size_t before = client_.feedback.size();
  ASSERT_TRUE(waitFor([&] { return client_.feedback.size() > before + 5; }));
  EXPECT_NEAR(client_.feedback.back().hoist_speed_mps, 0.052, 1e-9);
  ASSERT_TRUE(callTrigger("rig_node/reset").success);
  ASSERT_TRUE(client_.waitForEnd());
  EXPECT_EQ(client_.state(), State::ABORTED);
  EXPECT_NE(client_.result().message.find("reset"), std::string::npos) << client_.result().message;
}

TEST_F(PullUpByAction, CancelWhilePausedTakesEffectAtOnce) {
  client_.send(shortLift());
  ASSERT_TRUE(lifting());
  ASSERT_TRUE(callTrigger("rig_node/pause").success);
  client_.cancel();
  EXPECT_TRUE(client_.waitForEnd());
  EXPECT_EQ(client_.state(), State::PREEMPTED);
  ASSERT_TRUE(callTrigger("rig_node/resume").success);
  expectStopWithinThreeTenths();
}

TEST(PullUpOfAJammedCollector, EndsAtUnfoldWithAFailureThatSaysWhatToDo) {
  Client client("jammed/pull_up");
  ASSERT_TRUE(client.connect());
  client.send(fullGoal());
  ASSERT_TRUE(client.waitForEnd());
  EXPECT_EQ(client.state(), State::REJECTED) << "a paused rig takes no goal";
  EXPECT_NE(client.result().message.find("paused"), std::string::npos) << client.result().message;

  ASSERT_TRUE(callTrigger("jammed/rig_node/resume").success);
  PullUpGoal goal = fullGoal();
  goal.depth_m = 0.1;
  client.send(goal);
  ASSERT_TRUE(client.waitForEnd());
  EXPECT_EQ(client.state(), State::ABORTED);
  EXPECT_FALSE(client.result().success);
  EXPECT_NE(client.result().message.find("stage unfold, fold ratio 0.4: fold_jammed: The arms stick"),
            std::string::npos)
      << client.result().message;
  EXPECT_GT(client.result().peak_force_n, 0.0);
  EXPECT_TRUE(callTrigger("jammed/rig_node/pause").success);
}

TEST(PullUpOfAnUnlockedCollector, EndsBeforeTheLift) {
  Client client("unlocked/pull_up");
  ASSERT_TRUE(client.connect());
  ASSERT_TRUE(callTrigger("unlocked/rig_node/resume").success);
  PullUpGoal goal = fullGoal();
  goal.depth_m = 0.0;
  client.send(goal);
  ASSERT_TRUE(client.waitForEnd());
  EXPECT_EQ(client.state(), State::ABORTED);
  EXPECT_NE(client.result().message.find("fold_unlocked"), std::string::npos) << client.result().message;
  for (const auto& feedback : client.feedback) EXPECT_NE(feedback.stage, "lift");
  EXPECT_TRUE(callTrigger("unlocked/rig_node/pause").success);
}

TEST(PullUpUnderAScript, IsRejected) {
  Client client("scripted/pull_up");
  ASSERT_TRUE(client.connect());
  client.send(shortLift());
  ASSERT_TRUE(client.waitForEnd());
  EXPECT_EQ(client.state(), State::REJECTED);
  EXPECT_NE(client.result().message.find("procedure.control = scripted, must be manual"), std::string::npos)
      << client.result().message;
}

// ---- the command line client

struct Outcome {
  int code;
  std::string text;
};

Outcome runProgram(const std::string& arguments) {
  const std::string command = "timeout 60 " PULL_UP_PROGRAM " --ns / " + arguments + " 2>&1";
  FILE* pipe = popen(command.c_str(), "r");
  std::string text;
  char buffer[256];
  while (std::fgets(buffer, sizeof buffer, pipe) != nullptr) text += buffer;
  const int status = pclose(pipe);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text};
}

using PullUpProgram = PullUpByAction;

TEST_F(PullUpProgram, RunsATestAndSaysWhatCameOut) {
  const Outcome outcome = runProgram("--lift-speed 0.1 --lift-duration 2");
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("lift    t "), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find("peak force"), std::string::npos) << outcome.text;
}

TEST_F(PullUpProgram, BadInputIsTwo) {
  EXPECT_EQ(runProgram("").code, 2) << "neither height nor duration";
  const Outcome outcome = runProgram("--lift-speed 9 --lift-duration 2");
  EXPECT_EQ(outcome.code, 2) << outcome.text;
  EXPECT_NE(outcome.text.find("lift_speed_mps = 9"), std::string::npos) << outcome.text;
}

TEST_F(PullUpProgram, InterruptCancelsAndIsOne) {
  const std::string log = testing::TempDir() + "pull_up_interrupted_" + std::to_string(getpid());
  const std::string command = "exec " PULL_UP_PROGRAM " --ns / --lift-duration 60 > " + log + " 2>&1";
  const char* const arguments[] = {"sh", "-c", command.c_str(), nullptr};
  pid_t child = 0;
  ASSERT_EQ(posix_spawn(&child, "/bin/sh", nullptr, nullptr, const_cast<char* const*>(arguments), environ), 0);
  EXPECT_TRUE(lifting());
  kill(child, SIGINT);
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 1);
  std::ostringstream text;
  text << std::ifstream(log).rdbuf();
  std::remove(log.c_str());
  EXPECT_NE(text.str().find("canceled, in stage lift"), std::string::npos) << text.str();
  EXPECT_TRUE(joints_.waitForNew(stands));
}

int actAsClient(int argc, char** argv) {
  ros::init(argc, argv, "client_to_be_killed", ros::init_options::NoSigintHandler);
  ros::NodeHandle node;
  Client client;
  if (!client.connect()) return 1;
  client.send(shortLift());
  spinFor(60.0);
  return 0;
}

/// Sends a goal as a bare message and subscribes to nothing.
int actAsDeafSender(int argc, char** argv) {
  ros::init(argc, argv, "deaf_sender", ros::init_options::NoSigintHandler);
  ros::NodeHandle node;
  auto publisher = node.advertise<PullUpActionGoal>("pull_up/goal", 1, /* latch= */ true);
  PullUpActionGoal goal;
  goal.goal = shortLift();
  publisher.publish(goal);
  spinFor(60.0);
  return 0;
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  if (argc >= 2 && std::strcmp(argv[1], "--client") == 0) return brash_ice_rig::actAsClient(argc, argv);
  if (argc >= 2 && std::strcmp(argv[1], "--deaf-sender") == 0) return brash_ice_rig::actAsDeafSender(argc, argv);
  return brash_ice_rig::runRosTest(argc, argv, "pull_up_action_test");
}
