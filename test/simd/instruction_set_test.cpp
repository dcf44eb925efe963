#include "brash_ice_rig/simd/instruction_set.h"

#include <cstdlib>
#include <string>

#include <gtest/gtest.h>

#include "brash_ice_rig/simulation/simulation.h"

namespace brash_ice_rig {
namespace {

/// Sets the variable that chooses, and puts it back.
class Choice {
 public:
  explicit Choice(const char* name) {
    if (const char* before = std::getenv(kVariable)) before_ = before;
    setenv(kVariable, name, 1);
  }
  ~Choice() { before_.empty() ? unsetenv(kVariable) : setenv(kVariable, before_.c_str(), 1); }
  Choice(const Choice&) = delete;
  Choice& operator=(const Choice&) = delete;

 private:
  static constexpr const char* kVariable = "BRASH_ICE_INSTRUCTION_SET";
  std::string before_;
};

TEST(InstructionSet, BaselineIsAlwaysThereAndTheWidestIsTaken) {
  const auto sets = availableInstructionSets();
  ASSERT_FALSE(sets.empty());
  EXPECT_EQ(sets.front(), InstructionSet::kBaseline);
  const Choice none("");
  EXPECT_EQ(chosenInstructionSet(), sets.back());
}

TEST(InstructionSet, TheVariableChoosesAmongThoseOfTheMachineAndNothingElse) {
  for (const InstructionSet set : availableInstructionSets()) {
    const Choice choice(nameOf(set));
    EXPECT_EQ(chosenInstructionSet(), set) << nameOf(set);
  }
  const Choice nonsense("avx1024");
  EXPECT_EQ(chosenInstructionSet(), availableInstructionSets().back());
}

// The promise that a run repeats on another machine: plasticity, damage, contact and a plug that tears.
TEST(InstructionSet, AllGiveTheSameBits) {
  Scenario s;
  s.field.length_x_m = s.field.length_y_m = 6.0;
  s.collector.radius_m = 0.7;
  s.collector.rim_height_m = 0.2;
  s.procedure.settle_duration_s = 1.0;
  s.solver.threads = 1;
  std::uint64_t expected = 0;
  for (const InstructionSet set : availableInstructionSets()) {
    const Choice choice(nameOf(set));
    Simulation simulation(s);
    simulation.advance(4.0);
    if (set == InstructionSet::kBaseline) expected = simulation.stateHash();
    EXPECT_EQ(simulation.stateHash(), expected) << nameOf(set);
  }
}

}  // namespace
}  // namespace brash_ice_rig
