#include <algorithm>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/TwistStamped.h>
#include <std_msgs/String.h>

#include "test_support.h"

namespace brash_ice_rig {
namespace {

// The node of status_test.test is asked for 1000 times real time, which no computer reaches.
TEST(Status, OverloadIsReportedWithItsRemedyAndTheStepStays) {
  Listener<SimStatus> status("sim/status");
  ASSERT_TRUE(status.waitForNew());
  const double step_s = status.last().time_step_s;
  ASSERT_TRUE(status.waitForNew([](const SimStatus& s) { return hasFlag(s, SimStatus::OVERLOAD); }));
  const SimStatus& overloaded = status.last();
  const auto index = static_cast<std::size_t>(findFlag(overloaded, SimStatus::OVERLOAD));
  ASSERT_EQ(overloaded.flag_names.size(), overloaded.remedies.size());
  EXPECT_EQ(overloaded.flag_names.at(index), "overload");
  EXPECT_NE(overloaded.remedies.at(index).find("real_time_factor"), std::string::npos);
  EXPECT_EQ(overloaded.real_time_factor_target, 1000.0);
  EXPECT_GT(overloaded.real_time_factor, 0.0);
  EXPECT_LT(overloaded.real_time_factor, 1000.0);
  EXPECT_EQ(overloaded.time_step_s, step_s);
}

TEST(Status, AchievedFactorAndStepRateAgreeWithTheStepsTaken) {
  Listener<SimStatus> status("sim/status");
  spinFor(3.0);
  ASSERT_GT(status.messages.size(), 10u);
  const SimStatus &first = status.first(), &last = status.last();
  const double wall_s = status.arrivals_s.back() - status.arrivals_s.front();
  const double steps_per_s = static_cast<double>(last.step_count - first.step_count) / wall_s;
  EXPECT_NEAR(last.step_rate_hz / steps_per_s, 1.0, 0.3);
  EXPECT_NEAR(last.real_time_factor, last.step_rate_hz * last.time_step_s, 1e-6 * last.real_time_factor);
}

TEST(Status, CommandWhileTheScriptDrivesIsFlagged) {
  Listener<SimStatus> status("sim/status");
  ros::NodeHandle node;
  auto publisher = node.advertise<geometry_msgs::TwistStamped>("crane/cmd_vel", 1);
  ASSERT_TRUE(waitFor([&] { return publisher.getNumSubscribers() > 0; }));
  publisher.publish(geometry_msgs::TwistStamped());
  EXPECT_TRUE(status.waitForNew([](const SimStatus& s) { return hasFlag(s, SimStatus::COMMAND_IGNORED); }));
}

TEST(Status, ScenarioIsLatchedWithVersionAndSeed) {
  Listener<std_msgs::String> scenario("sim/scenario");
  ASSERT_TRUE(waitFor([&] { return !scenario.messages.empty(); }));
  const std::string& text = scenario.last().data;
  EXPECT_EQ(text.rfind("# brash_ice_rig ", 0), 0u) << text;
  EXPECT_NE(text.find("hold_duration_s: 600"), std::string::npos) << "settings are in the effective scenario";
  EXPECT_NE(text.find("seed:"), std::string::npos);
}

TEST(Diagnostics, NamesEveryPartOnceASecond) {
  Listener<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  const auto isReport = [](const diagnostic_msgs::DiagnosticArray& array) { return array.status.size() >= 4; };
  ASSERT_TRUE(diagnostics.waitForNew(isReport));
  std::vector<std::string> names;
  for (const auto& part : diagnostics.last().status) {
    names.push_back(part.name.substr(part.name.find(": ") + 2));
  }
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (std::vector<std::string>{"Commands", "Load cell", "Numerics", "Real time"}));
  EXPECT_TRUE(diagnostics.waitForNew(isReport, 2.5));
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "status_test");
}
