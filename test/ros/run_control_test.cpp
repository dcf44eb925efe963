#include <rosgraph_msgs/Clock.h>

#include <geometry_msgs/WrenchStamped.h>

#include "test_support.h"

namespace brash_ice_rig {
namespace {

// The node of run_control_test.test starts paused. Each test leaves it paused.
class RunControl : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(wrench_.waitForConnection());
    ASSERT_TRUE(status_.waitForNew([](const SimStatus& status) { return status.paused; }));
  }

  const SimStatus& status() { return status_.last(); }

  bool waitForStatus(const std::function<bool(const SimStatus&)>& condition) { return status_.waitForNew(condition); }

  static Step::Response step(double duration_s) { return callStep("rig_node/step", duration_s); }

  Listener<SimStatus> status_{"sim/status"};
  Listener<rosgraph_msgs::Clock> clock_{"/clock"};
  Listener<geometry_msgs::WrenchStamped> wrench_{"load_cell/wrench"};
};

TEST_F(RunControl, StartPausedStandsStill) {
  const std::uint64_t steps = status().step_count;
  spinFor(1.0);
  EXPECT_EQ(status().step_count, steps);
  EXPECT_EQ(status().real_time_factor, 0.0);
  EXPECT_TRUE(wrench_.messages.empty()) << "a pause makes no load-cell samples";
}

TEST_F(RunControl, ClockIsAliveAndPositiveWhilePaused) {
  ASSERT_TRUE(clock_.waitForNew());
  const ros::Time first = clock_.last().clock;
  EXPECT_GT(first.toSec(), 0.0);
  ASSERT_TRUE(clock_.waitForNew());
  EXPECT_GE(clock_.last().clock, first);
  EXPECT_LT((clock_.last().clock - first).toSec(), 1e-3);
}

TEST_F(RunControl, StepSingleWhilePaused) {
  const std::uint64_t before = status().step_count;
  const auto answer = step(1e-9);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_TRUE(waitForStatus([&](const SimStatus& s) { return s.step_count == before + 1; }));
  EXPECT_TRUE(status().paused);
}

TEST_F(RunControl, StepRunsExactlyTheDurationAskedFor) {
  const double before_s = status().time_s;
  const auto answer = step(0.1);
  EXPECT_TRUE(answer.success) << answer.message;
  ASSERT_TRUE(waitForStatus([&](const SimStatus& s) { return s.time_s > before_s + 0.05; }));
  EXPECT_NEAR(status().time_s - before_s, 0.1, 1e-9);
  EXPECT_TRUE(waitFor([&] { return wrench_.messages.size() == 10; })) << wrench_.messages.size();
}

TEST_F(RunControl, StepNegativeFails) {
  const std::uint64_t before = status().step_count;
  for (const double duration_s : {-0.1, 0.0, 1e9, std::nan("")}) {
    const auto answer = step(duration_s);
    EXPECT_FALSE(answer.success);
    EXPECT_NE(answer.message.find("duration_s"), std::string::npos) << answer.message;
  }
  ASSERT_TRUE(status_.waitForNew());
  EXPECT_EQ(status().step_count, before);
}

TEST_F(RunControl, PauseWhilePausedFails) {
  const auto answer = callTrigger("rig_node/pause");
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.message, "is paused already");
}

TEST_F(RunControl, ResumeAndPause) {
  const double before_s = status().time_s;
  EXPECT_TRUE(callTrigger("rig_node/resume").success);
  EXPECT_TRUE(waitForStatus([&](const SimStatus& s) { return !s.paused && s.time_s > before_s + 0.2; }));
  EXPECT_FALSE(callTrigger("rig_node/resume").success);
  EXPECT_FALSE(step(0.1).success) << "step is for a paused rig";
  EXPECT_TRUE(callTrigger("rig_node/pause").success);
  // It stood still when the service answered.
  ASSERT_TRUE(waitForStatus([](const SimStatus& s) { return s.paused; }));
  const std::uint64_t steps = status().step_count;
  ASSERT_TRUE(status_.waitForNew());
  EXPECT_EQ(status().step_count, steps);
}

TEST_F(RunControl, ResetReturnsToTheStart) {
  ASSERT_TRUE(step(1.5).success);
  ASSERT_TRUE(waitForStatus([](const SimStatus& s) { return s.stage == "lift"; }));
  EXPECT_TRUE(callTrigger("rig_node/reset").success);
  ASSERT_TRUE(waitForStatus([](const SimStatus& s) { return s.step_count == 0; }));
  EXPECT_EQ(status().stage, "settle");
  EXPECT_NEAR(status().time_s, -1.0, 1e-9);
  EXPECT_TRUE(status().paused);
}

TEST_F(RunControl, ClockStaysMonotonicOverResetAndTopicsLiveOn) {
  ASSERT_TRUE(callTrigger("rig_node/resume").success);
  ASSERT_TRUE(wrench_.waitForNew());
  ASSERT_TRUE(callTrigger("rig_node/reset").success);
  const std::size_t samples = wrench_.messages.size();
  ASSERT_TRUE(waitFor([&] { return wrench_.messages.size() > samples + 50; }));
  ASSERT_TRUE(callTrigger("rig_node/pause").success);
  for (std::size_t i = 1; i < clock_.messages.size(); ++i) {
    ASSERT_GE(clock_.messages[i].clock, clock_.messages[i - 1].clock);
  }
  for (std::size_t i = 1; i < wrench_.messages.size(); ++i) {
    ASSERT_GT(wrench_.messages[i].header.stamp, wrench_.messages[i - 1].header.stamp);
  }
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "run_control_test");
}
