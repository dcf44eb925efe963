#include "brash_ice_rig/simulation/pinned_thread.h"

#include <gtest/gtest.h>

#include "brash_ice_rig/simulation/simulation.h"

namespace brash_ice_rig {
namespace {

TEST(PinnedThread, StaysOnItsCoreUntilTheEndAndOnThatOfAnotherInTurn) {
  const std::vector<int> cores = allowedCores();
  if (cores.empty()) GTEST_SKIP() << "the system does not tell cores";
  for (std::size_t index = 0; index < cores.size() + 1; ++index) {
    const PinnedThread pinned(cores, index);
    EXPECT_EQ(allowedCores(), std::vector<int>{cores[index % cores.size()]});
  }
  EXPECT_EQ(allowedCores(), cores);
}

TEST(PinnedThread, MayRunAnywhereWithoutCores) {
  const std::vector<int> cores = allowedCores();
  const PinnedThread free({}, 1);
  EXPECT_EQ(allowedCores(), cores);
}

TEST(PinnedThread, OfASimulationChangesNoResultAndIsFreeAfterwards) {
  const std::vector<int> cores = allowedCores();
  const auto hashAfterAMoment = [](bool pin) {
    Scenario s;
    s.field.length_x_m = s.field.length_y_m = 6.0;
    s.solver.pin_threads = pin;
    Simulation simulation(s);
    simulation.advance(0.05);
    return simulation.stateHash();
  };
  EXPECT_EQ(hashAfterAMoment(true), hashAfterAMoment(false));
  EXPECT_EQ(allowedCores(), cores);
}

}  // namespace
}  // namespace brash_ice_rig
