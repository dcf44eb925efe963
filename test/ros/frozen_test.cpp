#include <diagnostic_msgs/DiagnosticArray.h>

#include "test_support.h"

namespace brash_ice_rig {
namespace {

// The contact of frozen_test.test is far too stiff for its time step: it throws ice out of all bounds.
TEST(FrozenWorld, NodeLivesOnAndNamesTheRemedy) {
  Listener<SimStatus> status("sim/status");
  ASSERT_TRUE(status.waitForNew([](const SimStatus& s) { return s.frozen; }, 30.0));
  ASSERT_TRUE(status.waitForNew([](const SimStatus& s) { return hasFlag(s, SimStatus::NON_FINITE); }));
  const SimStatus& frozen = status.last();
  const auto index = static_cast<std::size_t>(findFlag(frozen, SimStatus::NON_FINITE));
  EXPECT_EQ(frozen.flag_names.at(index), "non_finite");
  EXPECT_FALSE(frozen.remedies.at(index).empty());
  const std::uint64_t steps = frozen.step_count;
  ASSERT_TRUE(status.waitForNew());
  EXPECT_EQ(status.last().step_count, steps);

  Listener<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  EXPECT_TRUE(diagnostics.waitForNew([](const diagnostic_msgs::DiagnosticArray& array) {
    for (const auto& part : array.status) {
      if (part.level == diagnostic_msgs::DiagnosticStatus::ERROR) return true;
    }
    return false;
  }));
}

TEST(FrozenWorld, ResumeFailsAndResetHelps) {
  Listener<SimStatus> status("sim/status");
  ASSERT_TRUE(status.waitForNew([](const SimStatus& s) { return s.frozen; }, 30.0));
  const auto answer = callTrigger("rig_node/resume");
  EXPECT_FALSE(answer.success);
  EXPECT_NE(answer.message.find("reset"), std::string::npos) << answer.message;
  EXPECT_TRUE(callTrigger("rig_node/reset").success);
  EXPECT_TRUE(status.waitForNew([](const SimStatus& s) { return !s.frozen; }));
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "frozen_test");
}
