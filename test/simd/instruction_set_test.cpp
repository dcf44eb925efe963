#include "brash_ice_rig/simd/instruction_set.h"

#include <cstdlib>
#include <string>

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "../output/shell.h"
#include "../output/temporary_directory.h"
#include "brash_ice_rig/effects/effect_registry.h"
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

/// The hash of the state in which a run of the program ends, and that the run was one worth the name.
std::string finalHash(const std::string& environment, int threads) {
  const TemporaryDirectory directory;
  // All that computes: plasticity, damage, contact of net and pole, every effect, noise.
  std::string effects;
  for (const EffectDescription& effect : effectRegistry()) {
    effects += std::string(" --set effects.") + effect.name + ".enabled=true";
  }
  directory.put("all.yaml",
                "title: All there is\n"
                "field: {length_x_m: 4.8, length_y_m: 4.8, jitter_ratio: 0.1, seed: 3}\n"
                "collector: {radius_m: 0.7, rim_height_m: 0.2}\n"
                "procedure: {settle_duration_s: 1.0, lift_speed_mps: 0.3, lift_duration_s: 4, hold_duration_s: 0}\n"
                "load_cell: {noise_n: 10}\n");
  const Outcome run =
      runShell("cd '" + directory.path() + "' && env OMP_WAIT_POLICY=passive " + environment +
               " '" BRASH_ICE_PROGRAM "' run all.yaml --out out --threads " + std::to_string(threads) + effects);
  EXPECT_EQ(run.exit_code, 0) << run.text;
  if (run.exit_code != 0) return "";
  const YAML::Node summary = YAML::LoadFile(directory.file("out/summary.json"));
  EXPECT_EQ(summary["threads"].as<int>(), threads);
  EXPECT_GT(summary["peak_force_n"].as<double>(), 2000.0) << "nothing was lifted";
  return summary["state_hash"].as<std::string>();
}

// x86-64-v2, v3 and v4 machines by what of them the program and the C library would use. The library has other code for
// machines with fused multiply-add, which these names of old and new versions of it switch off.
TEST(InstructionSet, TheProgramEndsInTheSameStateOnEveryMachineAndNumberOfThreads) {
  const std::string without_fma =
      "GLIBC_TUNABLES=glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2,-FMA_Usable,-FMA4_Usable,-AVX2_Usable ";
  const std::string variable = "BRASH_ICE_INSTRUCTION_SET=";
  const std::string expected = finalHash(variable + "baseline", 1);
  EXPECT_EQ(finalHash(without_fma + variable + "baseline", 2), expected) << "x86-64-v2";
  for (const InstructionSet set : availableInstructionSets()) {
    if (set == InstructionSet::kBaseline) continue;
    for (const int threads : {1, 2}) EXPECT_EQ(finalHash(variable + nameOf(set), threads), expected) << nameOf(set);
  }
}

}  // namespace
}  // namespace brash_ice_rig
