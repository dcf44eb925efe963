#include <cmath>

#include <gtest/gtest.h>

#include "brash_ice_rig/simulation/simulation.h"
#include "effect_bench.h"

namespace brash_ice_rig {
namespace {

/// What the pores of a particle hold when it has left the water with all of them full of a third of it: 0.6 of 27
/// litres.
constexpr double kPoreWater = 16.2;

TEST(Drainage, HeldShareOfTheVoidsComesOutWithTheIceAndDrainsExponentially) {
  const auto drainage = makeEffect("drainage", {{"held_ratio", 0.3}, {"drain_time_s", 8.0}});
  IceBench ice(1);
  ice.step(*drainage);
  EXPECT_EQ(ice.changes.held_water_kg[0], 0.0f);
  ice.position[0].z() = 1.0;
  ice.step(*drainage);
  EXPECT_NEAR(ice.changes.held_water_kg[0], 0.3 * kPoreWater, 1e-5);
  ice.run(*drainage, 8.0);
  EXPECT_NEAR(ice.changes.held_water_kg[0], 0.3 * kPoreWater * std::exp(-1.0), 1e-5);
}

TEST(Drainage, SquareRootLawLosesHalfInAQuarterOfItsTimeAndAllAtItsEnd) {
  const auto drainage = makeEffect("drainage", {{"held_ratio", 1.0}, {"drain_time_s", 8.0}, {"square_root", 1.0}});
  IceBench ice(1);
  ice.step(*drainage);
  ice.position[0].z() = 1.0;
  ice.step(*drainage);
  ice.run(*drainage, 2.0);
  EXPECT_NEAR(ice.changes.held_water_kg[0], 0.5 * kPoreWater, 1e-4);
  ice.run(*drainage, 6.0);
  EXPECT_NEAR(ice.changes.held_water_kg[0], 0.0, 1e-3);
}

TEST(Drainage, SteadyEmergenceBalancesInflowAndOutflow) {
  // Rising at v for dx / v, water is taken at a constant rate q; dw/dt = q - w / tau gives w = q tau (1 - exp(-t /
  // tau)).
  const double tau = 4.0, speed = 0.06, emergence = 0.3 / speed;
  const auto drainage = makeEffect("drainage", {{"held_ratio", 1.0}, {"drain_time_s", tau}});
  IceBench ice(1);
  ice.position[0].z() = -0.15;
  ice.step(*drainage);
  for (int k = 0; k < 2000; ++k) {
    ice.position[0].z() += speed * ice.time_step_s;
    ice.step(*drainage);
  }
  ASSERT_NEAR(ice.position[0].z(), 0.15, 1e-9);
  const double inflow = kPoreWater / emergence;
  EXPECT_NEAR(ice.changes.held_water_kg[0], inflow * tau * (1.0 - std::exp(-emergence / tau)), 2e-3 * kPoreWater);
}

TEST(Drainage, WaterIsNeitherMadeNorKeptBelowTheWaterline) {
  const auto drainage = makeEffect("drainage", {{"held_ratio", 1.0}, {"drain_time_s", 3600.0}});
  IceBench ice(2);
  ice.position[1].z() = 0.5;  // stood in the air from the start
  ice.step(*drainage);
  ice.position[0].z() = 1.0;
  ice.position[1].z() = 1.5;
  ice.step(*drainage);
  EXPECT_NEAR(ice.changes.held_water_kg[0], kPoreWater, 1e-4);
  EXPECT_EQ(ice.changes.held_water_kg[1], 0.0f);
  ice.position[0].z() = 0.0;  // half of it sinks again
  ice.step(*drainage);
  EXPECT_NEAR(ice.changes.held_water_kg[0], 0.5 * kPoreWater, 1e-3);
  ice.position[0].z() = 1.0;
  ice.step(*drainage);
  EXPECT_NEAR(ice.changes.held_water_kg[0], kPoreWater, 2e-3) << "and is wetted anew";
  ice.position[0].z() = -1.0;
  ice.step(*drainage);
  EXPECT_EQ(ice.changes.held_water_kg[0], 0.0f);
}

TEST(Drainage, IceThatBobsWetsOnlyTheBandThatItBobsIn) {
  for (const double square_root : {0.0, 1.0}) {
    const auto drainage =
        makeEffect("drainage", {{"held_ratio", 1.0}, {"drain_time_s", 10.0}, {"square_root", square_root}});
    IceBench ice(1);
    ice.position[0].z() = 0.0;  // half of it stands in the air
    for (int k = 0; k < 4000; ++k) {
      ice.position[0].z() = k % 2 == 0 ? 0.0 : 0.001;
      ice.step(*drainage);
      ASSERT_LE(ice.changes.held_water_kg[0], kPoreWater * 0.001 / 0.3 * 1.0001);
    }
  }
}

TEST(Drainage, HeldWaterWeighsOnThePlug) {
  const auto gravity = [](bool wet) {
    Scenario s = smallLift();
    s.solver.stiffness_scale = 1.0e-4;  // weight is what counts here
    s.procedure.lift_duration_s = 5.0;
    if (wet) enable(s, "drainage", {{"held_ratio", 1.0}, {"drain_time_s", 3600.0}});
    Simulation simulation(s);
    simulation.advance(5.5);
    const Snapshot now = simulation.snapshot();
    return now.components.plug_gravity_n / (simulation.plug().lifted_mass_kg * 9.81);
  };
  EXPECT_NEAR(gravity(false), 1.0, 1e-4);
  // Clear of the water, voids of 60 % hold 0.6 x 1000 kg for each 0.4 x 900 kg of ice.
  EXPECT_GT(gravity(true), 1.5);
  EXPECT_LT(gravity(true), 1.0 + 600.0 / 360.0);
}

}  // namespace
}  // namespace brash_ice_rig
