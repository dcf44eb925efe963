#include <numeric>

#include <gtest/gtest.h>

#include "brash_ice_rig/simulation/simulation.h"
#include "effect_bench.h"

namespace brash_ice_rig {
namespace {

/// Ten particles in a row from the axis to the rim, in the collector, and one under it.
IceBench loadedCollector() {
  IceBench ice(11);
  for (std::size_t i = 0; i < 10; ++i) {
    ice.site[i] = {0.13 * static_cast<double>(i), 0.0, -0.9};
    ice.position[i] = ice.site[i] + Eigen::Vector3d(0.0, 0.0, 1.5);
  }
  ice.hub.z() = 0.3;
  ice.position[10].z() = 0.0;
  return ice;
}

double massOf(const IceBench& ice) {
  return 9.72 * std::accumulate(ice.changes.solid_ratio.begin(), ice.changes.solid_ratio.end(), 0.0);
}

TEST(BlockDrop, ThreeFallsTakeTheirMassesInTheirTimes) {
  const auto drop = makeEffect("block_drop", {{"mass_1_kg", 4.0},
                                              {"time_1_s", 1.0},
                                              {"duration_1_s", 0.5},
                                              {"mass_2_kg", 3.0},
                                              {"time_2_s", 2.0},
                                              {"duration_2_s", 1.0},
                                              {"mass_3_kg", 5.0},
                                              {"time_3_s", 4.0},
                                              {"duration_3_s", 0.1}});
  IceBench ice = loadedCollector();
  const double start = massOf(ice);
  ice.run(*drop, 1.0);
  EXPECT_EQ(massOf(ice), start);
  ice.run(*drop, 0.25);
  EXPECT_NEAR(start - massOf(ice), 2.0, 1e-3) << "a fall is symmetric about its middle";
  ice.run(*drop, 0.5);
  EXPECT_NEAR(start - massOf(ice), 4.0, 1e-3);
  ice.run(*drop, 1.5);
  EXPECT_NEAR(start - massOf(ice), 7.0, 1e-3);
  ice.run(*drop, 3.0);
  EXPECT_NEAR(start - massOf(ice), 12.0, 1e-3);
}

TEST(BlockDrop, TakesFromTheRimAndOnlyWhatLiesOnTheCollector) {
  const auto drop = makeEffect("block_drop", {{"mass_1_kg", 5.0}, {"time_1_s", 0.1}, {"duration_1_s", 0.5}});
  IceBench ice = loadedCollector();
  ice.run(*drop, 1.0);
  const auto& ratio = ice.changes.solid_ratio;
  EXPECT_EQ(ratio[0], 1.0f) << "on the axis";
  EXPECT_EQ(ratio[10], 1.0f) << "below the collector";
  EXPECT_NEAR((1.0 - ratio[8]) / (1.0 - ratio[4]), 4.0, 1e-3) << "with the square of the distance";
}

TEST(BlockDrop, WhatIsAfloatDoesNotFall) {
  const auto drop = makeEffect("block_drop", {{"mass_1_kg", 5.0}, {"time_1_s", 0.1}, {"duration_1_s", 0.5}});
  IceBench ice = loadedCollector();
  ice.hub.z() = -0.5;
  ice.position[9].z() = -0.3;  // a particle is 0.3 m high
  ice.position[8].z() = 0.0;
  ice.run(*drop, 1.0);
  const auto& ratio = ice.changes.solid_ratio;
  EXPECT_EQ(ratio[9], 1.0f) << "under water";
  EXPECT_NEAR((1.0 - ratio[8]) / (1.0 - ratio[4]), 0.5 * 4.0, 1e-3) << "half of it above";
  EXPECT_NEAR(massOf(loadedCollector()) - massOf(ice), 5.0, 1e-3) << "from the others, so that it is all the same";
}

TEST(BlockDrop, NoMoreFallsThanThereIs) {
  const auto drop = makeEffect("block_drop", {{"mass_1_kg", 1000.0}, {"time_1_s", 0.1}, {"duration_1_s", 0.5}});
  IceBench ice = loadedCollector();
  ice.run(*drop, 1.0);
  for (const float ratio : ice.changes.solid_ratio) EXPECT_GE(ratio, 0.1f);
  EXPECT_NEAR(ice.changes.solid_ratio[9], 0.1f, 1e-6);
}

TEST(BlockDrop, WeightLeavesTheLoadCell) {
  // The plug hangs clear of the water. In the step in which 80 kg go, the forces on the rest change by their weight.
  Scenario s = smallLift();
  s.solver.stiffness_scale = 1.0e-4;  // weight is what counts here
  s.procedure.lift_duration_s = 6.0;
  s.procedure.hold_duration_s = 4.0;
  const auto iceLoads = [](const Scenario& scenario) {
    Simulation simulation(scenario);
    std::vector<double> loads;
    simulation.advance(0.5 + 7.0);
    loads.push_back(-simulation.snapshot().ice_force_n.z());
    loads.push_back(simulation.plug().lifted_mass_kg);
    simulation.advance(2.5);
    loads.push_back(-simulation.snapshot().ice_force_n.z());
    loads.push_back(simulation.plug().lifted_mass_kg);
    return loads;
  };
  const std::vector<double> without = iceLoads(s);
  enable(s, "block_drop", {{"mass_1_kg", 80.0}, {"time_1_s", 7.2}, {"duration_1_s", 1.0}});
  const std::vector<double> with = iceLoads(s);
  EXPECT_EQ(with[0], without[0]) << "nothing before it falls";
  EXPECT_NEAR(with[3], with[1] - 80.0, 0.1);
  EXPECT_NEAR(without[2] - with[2], 80.0 * 9.81, 0.1 * 80.0 * 9.81);
}

}  // namespace
}  // namespace brash_ice_rig
