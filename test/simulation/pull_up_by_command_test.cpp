#include <gtest/gtest.h>

#include "brash_ice_rig/rig/pull_up_sequence.h"
#include "brash_ice_rig/simulation/simulation.h"

namespace brash_ice_rig {
namespace {

TEST(PullUpByCommand, LiftAfterSettlingHasTheBitsOfTheScript) {
  Scenario scripted;
  scripted.field.length_x_m = scripted.field.length_y_m = 4.8;
  scripted.collector.radius_m = 0.7;
  scripted.procedure.settle_duration_s = 0.5;
  scripted.procedure.lift_speed_mps = 0.2;
  scripted.procedure.lift_duration_s = 1.5;
  scripted.procedure.hold_duration_s = 0.5;
  scripted.solver.threads = 1;
  Simulation script(scripted);
  script.advance(3.0);

  Scenario manual = scripted;
  manual.procedure.control = ControlMode::kManual;
  Simulation commanded(manual);
  PullUpOrder order;
  order.lift_speed_mps = 0.2;
  order.lift_duration_s = 1.5;
  order.hold_duration_s = 0.5;
  PullUpSequence sequence(order, manual.crane, commanded.samplePeriod());
  StatusFlags raised, all;
  const std::uint64_t hash_at_start = commanded.stateHash();
  while (commanded.stepCount() < script.stepCount()) {
    const PullUpSequence::Drive drive = sequence.step(commanded.snapshot(), raised);
    commanded.setCraneVelocity({0.0, 0.0, drive.hoist_speed_mps});
    raised = commanded.advance(commanded.samplePeriod()).flags;
    all |= raised;
  }
  EXPECT_EQ(sequence.stage(), PullUpStage::kDone);
  EXPECT_FALSE(all.has(StatusFlag::kCommandTimeout));
  EXPECT_NE(commanded.stateHash(), hash_at_start);
  // The hash takes in stage and commands, which differ on purpose; the world may not.
  const ParticleCloud by_command = commanded.particles(), by_script = script.particles();
  EXPECT_EQ(by_command.x_m, by_script.x_m);
  EXPECT_EQ(by_command.y_m, by_script.y_m);
  EXPECT_EQ(by_command.z_m, by_script.z_m);
  EXPECT_EQ(by_command.speed_mps, by_script.speed_mps);
  EXPECT_EQ(by_command.pressure_pa, by_script.pressure_pa);
  EXPECT_EQ(by_command.plastic_strain, by_script.plastic_strain);
  EXPECT_EQ(by_command.damage, by_script.damage);
  EXPECT_EQ(commanded.snapshot().tension_n, script.snapshot().tension_n);
  EXPECT_EQ(commanded.snapshot().rig.crane_position_m, script.snapshot().rig.crane_position_m);
  EXPECT_EQ(commanded.activeParticleSteps(), script.activeParticleSteps());
}

}  // namespace
}  // namespace brash_ice_rig
