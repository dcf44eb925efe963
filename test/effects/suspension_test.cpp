// Effects on the suspension point and on the collector: heave, sideways path, loss of speed, elastic rope, water.

#include <cmath>

#include <gtest/gtest.h>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/math/angle.h"
#include "brash_ice_rig/simulation/simulation.h"
#include "effect_bench.h"

namespace brash_ice_rig {
namespace {

// ---- vessel_heave

double threeLines(double t) {
  return 0.05 * std::sin(2.0 * kPi * t / 6.0 + kPi / 6.0) + 0.02 * std::sin(2.0 * kPi * t / 8.5) +
         0.01 * std::sin(2.0 * kPi * t / 3.1 - kPi / 2.0);
}

constexpr EffectKeys kThreeLines = {{"amplitude_1_m", 0.05}, {"period_1_s", 6.0}, {"phase_1_deg", 30.0},
                                    {"amplitude_2_m", 0.02}, {"period_2_s", 8.5}, {"phase_2_deg", 0.0},
                                    {"amplitude_3_m", 0.01}, {"period_3_s", 3.1}, {"phase_3_deg", -90.0}};

TEST(VesselHeave, SuspensionPointFollowsThreeSpectralLines) {
  Scenario s = rigInTheAir();
  enable(s, "vessel_heave", kThreeLines);
  Simulation simulation(s);
  const double start = simulation.snapshot().rig.crane_position_m.z();
  const double hub = simulation.snapshot().rig.hoist_position_m;
  simulation.advance(0.5);
  EXPECT_EQ(simulation.snapshot().rig.crane_position_m.z(), start) << "at rest until time 0";
  simulation.advance(2.0);
  for (int k = 0; k < 8; ++k) {
    simulation.advance(0.7);
    const Snapshot now = simulation.snapshot();
    EXPECT_NEAR(now.rig.crane_position_m.z() - start, threeLines(now.time_s), 1e-12);
    EXPECT_NEAR(now.rig.hoist_position_m - hub, threeLines(now.time_s), 1e-12);
    const double h = 1e-4;
    const double speed = (threeLines(now.time_s + h) - threeLines(now.time_s - h)) / (2.0 * h);
    EXPECT_NEAR(now.rig.crane_velocity_mps.z(), speed, 1e-8);
    // The hanging rig is accelerated along.
    const double acceleration =
        (threeLines(now.time_s + h) - 2.0 * threeLines(now.time_s) + threeLines(now.time_s - h)) / (h * h);
    EXPECT_NEAR(now.tension_n, 240.0 * (9.81 + acceleration), 1e-4);
  }
}

TEST(VesselHeave, StartsWithoutAJumpOfSpeedOrAcceleration) {
  const auto heave = makeEffect("vessel_heave", kThreeLines);
  RigNow rig;
  rig.time_step_s = 0.0025;
  Motion before;
  for (rig.time_s = -0.1; rig.time_s < 2.5; rig.time_s += rig.time_step_s) {
    Suspension now;
    heave->updateSuspension(rig, now);
    const Eigen::Vector3d way = now.point.position_m - before.position_m;
    EXPECT_NEAR(way.z() / rig.time_step_s, 0.5 * (now.point.velocity_mps + before.velocity_mps).z(), 1e-5);
    EXPECT_NEAR((now.point.velocity_mps - before.velocity_mps).z() / rig.time_step_s,
                0.5 * (now.point.acceleration_mps2 + before.acceleration_mps2).z(), 1e-4);
    before = now.point;
  }
}

TEST(VesselHeave, BeginsWithTheRestBeforeTheLift) {
  Scenario s = rigInTheAir();
  s.procedure.rest_duration_s = 4.0;
  enable(s, "vessel_heave", kThreeLines);
  Simulation simulation(s);
  const double start = simulation.snapshot().rig.crane_position_m.z();
  simulation.advance(0.5);
  EXPECT_NEAR(simulation.snapshot().time_s, -4.0, 1e-12);
  EXPECT_EQ(simulation.snapshot().rig.crane_position_m.z(), start);
  simulation.advance(2.0);
  for (int k = 0; k < 4; ++k) {
    simulation.advance(0.4);
    const Snapshot now = simulation.snapshot();
    EXPECT_LT(now.time_s, 0.0);
    EXPECT_NEAR(now.rig.crane_position_m.z() - start, threeLines(now.time_s), 1e-12) << "its phase is that at time 0";
  }
}

TEST(VesselHeave, EnergyOfTheRigIsStillFound) {
  Scenario s = rigInTheAir();
  s.output.energy = true;
  enable(s, "vessel_heave", kThreeLines);
  Simulation simulation(s);
  simulation.advance(5.0);
  const EnergyBalance energy = *simulation.snapshot().energy;
  EXPECT_GT(std::abs(energy.crane_work_j), 10.0);
  EXPECT_NEAR(energy.rigImbalance(), 0.0, 1e-3 * std::abs(energy.crane_work_j));
}

// ---- pole_tilt

TEST(PoleTilt, HubDriftsAndSwaysAlongItsDirection) {
  Scenario s = rigInTheAir();
  enable(s, "pole_tilt",
         {{"drift_mps", 0.01}, {"sway_m", 0.1}, {"sway_period_s", 8.0}, {"direction_deg", 30.0}, {"lean_ratio", 0.0}});
  Simulation simulation(s);
  simulation.advance(0.5 + 5.0);
  const double way = 0.01 * 5.0 + 0.1 * std::sin(2.0 * kPi * 5.0 / 8.0);
  const Snapshot now = simulation.snapshot();
  EXPECT_NEAR(now.rig.crane_position_m.x(), way * std::cos(kPi / 6.0), 1e-12);
  EXPECT_NEAR(now.rig.crane_position_m.y(), way * 0.5, 1e-12);
  const double acceleration = -0.1 * std::pow(2.0 * kPi / 8.0, 2) * std::sin(2.0 * kPi * 5.0 / 8.0);
  EXPECT_NEAR(now.load_cell_force_n.y(), 240.0 * acceleration * 0.5, 1e-8) << "a lateral channel sees it";
}

TEST(PoleTilt, SwayFromRestGoesToOneSideAndBack) {
  Scenario s = rigInTheAir();
  enable(s, "pole_tilt",
         {{"drift_mps", 0.0}, {"sway_m", 0.1}, {"sway_period_s", 8.0}, {"sway_phase_deg", -90.0}, {"lean_ratio", 0.0}});
  Simulation simulation(s);
  simulation.advance(0.5 + 4.0);  // half a period: 0.1 (1 - cos(180 deg))
  EXPECT_NEAR(simulation.snapshot().rig.crane_position_m.x(), 0.2, 1e-12);
}

TEST(PoleTilt, LoadCellReadsAlongALeaningPole) {
  Scenario s = rigInTheAir();
  enable(s, "pole_tilt", {{"drift_mps", 0.06}, {"direction_deg", -90.0}, {"lean_ratio", 0.5}});
  Simulation simulation(s);
  simulation.advance(0.5 + 5.0);
  // 0.3 m at the foot of 6 m, half of it by leaning: 1/40 of the weight of 240 kg points back, towards +y. At a steady
  // speed in the air nothing resists.
  const Snapshot now = simulation.snapshot();
  EXPECT_NEAR(now.load_cell_force_n.y(), 240.0 * 9.81 / 40.0, 1e-6);
  EXPECT_NEAR(now.load_cell_force_n.x(), 0.0, 1e-9);
  EXPECT_NEAR(now.tension_n, 240.0 * 9.81, 1e-9) << "what the crane carries is as before";
}

TEST(PoleTilt, IceHoldsThePoleBack) {
  Scenario s = smallLift();
  enable(s, "pole_tilt", {{"drift_mps", 0.05}, {"direction_deg", 90.0}, {"lean_ratio", 0.0}});
  Simulation simulation(s);
  simulation.advance(3.0);
  EXPECT_GT(simulation.snapshot().load_cell_force_n.y(), 50.0);
}

TEST(PoleTilt, PathMustStayInTheField) {
  Scenario s;
  enable(s, "pole_tilt", {{"drift_mps", 0.2}});
  try {
    s.validate();
    ADD_FAILURE() << "accepted";
  } catch (const ConfigError& error) {
    EXPECT_EQ(std::string(error.what()),
              "effects.pole_tilt.drift_mps = 0.2, takes the collector 8 m sideways with sway_m, at most 5.6 m are free "
              "in the field");
  }
}

TEST(PoleTilt, SwayFromRestNeedsTwiceTheRoom) {
  Scenario s;
  s.collector.radius_m = 3.0;  // 3.9 m are free in the field of 15 m
  enable(s, "pole_tilt", {{"drift_mps", 0.0}, {"sway_m", 1.96}, {"sway_phase_deg", 0.0}});
  EXPECT_NO_THROW(s.validate());
  s.effects["pole_tilt"].set("sway_phase_deg", 90.0);
  EXPECT_THROW(s.validate(), ConfigError);
}

// ---- crane_speed

double speedUnder(double tension_n, double wanted_mps, EffectKeys keys) {
  const auto effect = makeEffect("crane_speed", keys);
  RigNow rig;
  rig.tension_n = tension_n;
  Eigen::Vector3d wanted(0.1, 0.0, wanted_mps);
  effect->updateCraneVelocity(rig, wanted);
  EXPECT_EQ(wanted.x(), 0.1) << "the boom is not the hoist";
  return wanted.z();
}

TEST(CraneSpeed, IsLostInProportionToTheTension) {
  EXPECT_NEAR(speedUnder(12000.0, 0.052, {{"loss_ratio", 0.04}}), 0.96 * 0.052, 1e-15);
  EXPECT_NEAR(speedUnder(6000.0, 0.052, {{"loss_ratio", 0.04}}), 0.98 * 0.052, 1e-15);
  EXPECT_NEAR(speedUnder(6000.0, -0.052, {{"loss_ratio", 0.04}}), -1.02 * 0.052, 1e-15) << "lowering runs away";
  EXPECT_EQ(speedUnder(-500.0, 0.052, {{"loss_ratio", 0.04}}), 0.052);
  EXPECT_EQ(speedUnder(1.0e6, 0.052, {{"loss_ratio", 0.5}}), 0.0) << "the winch stalls";
}

TEST(CraneSpeed, LiftIsSlowerByTheShareOfTheHangingRig) {
  Scenario s = rigInTheAir();
  enable(s, "crane_speed", {{"loss_ratio", 0.1}, {"reference_load_n", 2354.4}});
  Simulation simulation(s);
  simulation.advance(1.0);
  simulation.setCraneVelocity({0.0, 0.0, 0.05});
  simulation.advance(0.24);
  EXPECT_NEAR(simulation.snapshot().rig.crane_velocity_mps.z(), 0.9 * 0.05, 1e-9);
}

// ---- compliance

TEST(Compliance, RopeStretchesByLoadOverStiffness) {
  const auto rope = makeEffect("compliance", {{"compliance_mpn", 1.0 / 280000.0}, {"damping_ratio", 0.5}});
  RigNow rig;
  rig.time_step_s = 0.0025;
  rig.mass_kg = 240.0;
  rig.weight_n = 2354.4;
  rig.buoyancy_n = 300.0;
  Suspension now;
  rope->updateSuspension(rig, now);
  EXPECT_EQ(now.stretch.position_m.z(), 0.0) << "counted from the hanging rig";
  rig.ice_force_n.z() = -9000.0;
  rig.load_n.z() = -100.0;
  for (int k = 0; k < 2000; ++k) {
    now = Suspension();
    rope->updateSuspension(rig, now);
  }
  EXPECT_NEAR(now.stretch.position_m.z(), -9100.0 / 280000.0, 1e-9);
  EXPECT_NEAR(*now.tension_n, 2054.4 + 9100.0, 1e-6);
}

TEST(Compliance, RigBouncesWithItsNaturalFrequency) {
  // T = 2 pi sqrt(m / k), water that moves along included, and no damping: ten periods.
  const double mass = 240.0 + 60.0, stiffness = 100000.0;
  const auto rope = makeEffect("compliance", {{"compliance_mpn", 1.0 / stiffness}, {"damping_ratio", 0.0}});
  RigNow rig;
  rig.time_step_s = 0.0025;
  rig.mass_kg = 240.0;
  rig.added_mass_kg = 60.0;
  Suspension now;
  rope->updateSuspension(rig, now);
  rig.ice_force_n.z() = -1000.0;
  int upward_crossings = 0;
  double first = 0.0, last = 0.0, lowest = 0.0, before = 0.0;
  for (int k = 1; upward_crossings < 11 && k < 100000; ++k) {
    now = Suspension();
    rope->updateSuspension(rig, now);
    const double above = now.stretch.position_m.z() + 1000.0 / stiffness;
    lowest = std::min(lowest, now.stretch.position_m.z());
    if (before < 0.0 && above >= 0.0) {
      last = (k - above / (above - before)) * rig.time_step_s;
      if (upward_crossings++ == 0) first = last;
    }
    before = above;
  }
  EXPECT_NEAR((last - first) / 10.0, 2.0 * kPi * std::sqrt(mass / stiffness), 2e-4);
  EXPECT_NEAR(lowest, -2.0 * 1000.0 / stiffness, 1e-5) << "twice the static stretch, and nothing is lost";
}

TEST(Compliance, AlmostRigidRopeIsStableAndBearsTheLoad) {
  const auto rope = makeEffect("compliance", {{"compliance_mpn", 1.0e-12}});
  RigNow rig;
  rig.time_step_s = 0.0025;
  rig.mass_kg = 240.0;
  Suspension now;
  for (int k = 0; k < 4000; ++k) {
    rig.ice_force_n.z() = -1000.0 * std::sin(0.001 * k);
    now = Suspension();
    rope->updateSuspension(rig, now);
    ASSERT_NEAR(*now.tension_n, -rig.ice_force_n.z(), 2.0);
    ASSERT_NEAR(now.stretch.position_m.z(), 0.0, 1e-8);
  }
}

TEST(Compliance, SimulatedRigHangsLowerByWhatTheIceWeighs) {
  Scenario s = smallLift();
  enable(s, "compliance", {{"compliance_mpn", 2.0e-5}, {"damping_ratio", 0.3}});
  s.procedure.lift_duration_s = 1.5;
  s.procedure.hold_duration_s = 2.0;
  Simulation simulation(s);
  simulation.advance(4.0);
  const Snapshot now = simulation.snapshot();
  const double lift = -now.rig.crane_position_m.z() + s.collector.pole_length_m + now.rig.hoist_position_m;
  const double hanging = 240.0 * 9.81 - 1000.0 * 9.81 * (0.02 + kPi * 0.0025 * (1.08 + 0.2));
  EXPECT_NEAR(lift, -2.0e-5 * (now.tension_n - hanging), 0.05 * 2.0e-5 * now.tension_n);
  EXPECT_GT(now.tension_n - hanging, 500.0);
}

// ---- collector_hydrodynamics

RigLoads loadsAt(double hub_height_m, double speed_mps, EffectKeys keys = {}) {
  const auto water = makeEffect("collector_hydrodynamics", keys);
  RigNow rig;
  rig.hub_position_m.z() = hub_height_m;
  rig.hub_velocity_mps.z() = speed_mps;
  rig.arm_angle_rad = std::atan2(0.3, 1.3);
  RigLoads loads;
  water->addRigLoads(rig, loads);
  return loads;
}

TEST(CollectorHydrodynamics, DragIsHalfRhoCdAVSquaredAgainstTheMotion) {
  // An octagon of circumradius 1.3 m has 2 sqrt(2) 1.3² = 4.780 m², a fifth of it thread; arms 8 x 1.3 x 0.08 m².
  const double area = 0.2 * 2.0 * std::sqrt(2.0) * 1.69 + 8.0 * 1.3 * 0.08;
  EXPECT_NEAR(loadsAt(-1.38, 0.5).force_n.z(), -0.5 * 1000.0 * 1.2 * area * 0.25, 1e-9);
  EXPECT_NEAR(loadsAt(-1.38, -0.2).force_n.z(), 0.5 * 1000.0 * 1.2 * area * 0.04, 1e-9);
  EXPECT_NEAR(loadsAt(-1.38, 0.052).force_n.z(), -2.9, 0.1) << "the paper's speed";
}

TEST(CollectorHydrodynamics, AddedMassIsThatOfTheDisplacedCylinders) {
  const double net = 0.2 * 2.0 * std::sqrt(2.0) * 1.69 * 0.003, arms = 8.0 * 1.3 * 0.08 * 0.08;
  EXPECT_NEAR(loadsAt(-1.38, 0.0).added_mass_kg, 1000.0 * kPi / 4.0 * (net + arms), 1e-9);
}

TEST(CollectorHydrodynamics, EndsWhereTheCollectorLeavesTheWater) {
  const RigLoads whole = loadsAt(-0.3, 0.5), half = loadsAt(-0.15, 0.5), none = loadsAt(0.01, 0.5);
  EXPECT_NEAR(half.force_n.z(), 0.5 * whole.force_n.z(), 1e-9);
  EXPECT_NEAR(half.added_mass_kg, 0.5 * whole.added_mass_kg, 1e-9);
  EXPECT_EQ(none.force_n.z(), 0.0);
  EXPECT_EQ(none.added_mass_kg, 0.0);
}

TEST(CollectorHydrodynamics, LoadCellReadsDragAndInertiaOfTheWater) {
  Scenario s = smallLift();
  s.procedure.start_gap_m = 2.0;
  s.procedure.lift_duration_s = 2.0;
  s.procedure.lift_speed_mps = 0.4;
  const auto tensionAt = [&s](double time_s) {
    Simulation simulation(s);
    simulation.advance(0.5 + time_s);
    const Snapshot now = simulation.snapshot();
    EXPECT_EQ(now.ice_force_n.norm(), 0.0);
    return now.tension_n;
  };
  const double steady = tensionAt(1.5), starting = tensionAt(0.01);
  enable(s, "collector_hydrodynamics");
  const double area = 0.2 * 2.0 * std::sqrt(2.0) * 0.49 + 8.0 * 0.7 * 0.08;
  EXPECT_NEAR(tensionAt(1.5) - steady, 0.5 * 1000.0 * 1.2 * area * 0.16, 1e-6);
  const double added = 1000.0 * kPi / 4.0 * (0.2 * 2.0 * std::sqrt(2.0) * 0.49 * 0.003 + 8.0 * 0.7 * 0.0064);
  EXPECT_NEAR(tensionAt(0.01) - starting, added * 0.5, 0.05);  // 0.5 m/s², hardly any speed yet
}

}  // namespace
}  // namespace brash_ice_rig
