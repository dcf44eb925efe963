#include "brash_ice_rig/rig/procedure.h"

#include <vector>

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

constexpr double kStep = 0.0025;

struct Drill {
  Drill(const ProcedureConfig& procedure_config, const CollectorConfig& collector_config, double start_m,
        double lowest_m)
      : crane(CraneConfig(), {0.0, 0.0, start_m}),
        collector(collector_config, procedure_config.start == StartPose::kUnfoldedUnderIce),
        procedure(procedure_config, lowest_m) {}

  void run(double from_s, double to_s) {
    for (double t = from_s; t < to_s - 0.5 * kStep; t += kStep) {
      const auto order = procedure.step(t, kStep, crane, collector, crane.position().z());
      if (stages.empty() || stages.back() != procedure.stage()) stages.push_back(procedure.stage());
      crane.step(kStep, {0.0, 0.0, order.hoist_speed_mps}, flags);
      collector.step(kStep, order.fold_target, 0.0, flags);
      lowest = std::min(lowest, crane.position().z());
    }
  }

  Crane crane;
  Collector collector;
  Procedure procedure;
  StatusFlags flags;
  std::vector<Stage> stages;
  double lowest = 1e9;
};

ProcedureConfig full() {
  ProcedureConfig config;
  config.start = StartPose::kFoldedAboveIce;
  config.lower_speed_mps = 0.2;
  config.lift_speed_mps = 0.1;
  config.lift_duration_s = 20.0;
  config.hold_duration_s = 3.0;
  return config;
}

TEST(Procedure, FullTestGoesThroughEveryStageInOrder) {
  Drill drill(full(), CollectorConfig(), 2.0, -1.0);
  drill.run(-1.0, 60.0);
  EXPECT_EQ(drill.stages, (std::vector<Stage>{Stage::kSettle, Stage::kLower, Stage::kUnfold, Stage::kLift, Stage::kHold,
                                              Stage::kDone}));
}

TEST(Procedure, LoweringStopsAtTheGoalWithoutOvershoot) {
  Drill drill(full(), CollectorConfig(), 2.0, -1.0);
  drill.run(-1.0, 25.0);
  EXPECT_NEAR(drill.lowest, -1.0, 2e-3);
  EXPECT_GE(drill.lowest, -1.0 - 1e-4);
}

TEST(Procedure, PapersRunStartsWithTheLift) {
  Drill drill(ProcedureConfig(), CollectorConfig(), -1.38, -1.38);
  drill.run(-3.0, 39.9);
  EXPECT_EQ(drill.stages, (std::vector<Stage>{Stage::kSettle, Stage::kLift}));
  EXPECT_NEAR(drill.crane.velocity().z(), 0.052, 1e-12);
}

TEST(Procedure, LiftLastsItsDuration) {
  Drill drill(ProcedureConfig(), CollectorConfig(), -1.38, -1.38);
  drill.run(-3.0, 45.0);
  EXPECT_EQ(drill.procedure.stage(), Stage::kDone);
  // 40 s at 0.052 m/s; the ramps up and down at 0.5 m/s² cancel.
  EXPECT_NEAR(drill.crane.position().z(), -1.38 + 2.08, 1e-3);
}

TEST(Procedure, JamEndsTheTestAtUnfoldAsInTheField) {
  CollectorConfig jam;
  jam.fault = FoldFault::kJam;
  Drill drill(full(), jam, 2.0, -1.0);
  drill.run(-1.0, 60.0);
  EXPECT_EQ(drill.stages, (std::vector<Stage>{Stage::kSettle, Stage::kLower, Stage::kUnfold, Stage::kDone}));
  EXPECT_TRUE(drill.flags.has(StatusFlag::kFoldJammed));
  EXPECT_NEAR(drill.crane.position().z(), -1.0, 2e-3);
}

TEST(Procedure, ManualControlSettlesAndThenLeavesTheCraneAlone) {
  ProcedureConfig config;
  config.control = ControlMode::kManual;
  Drill drill(config, CollectorConfig(), -1.38, -1.38);
  drill.run(-3.0, 5.0);
  EXPECT_EQ(drill.stages, (std::vector<Stage>{Stage::kSettle, Stage::kManual}));
  EXPECT_EQ(drill.crane.position().z(), -1.38);
}

}  // namespace
}  // namespace brash_ice_rig
