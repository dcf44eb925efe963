#include "brash_ice_rig/rig/pull_up_sequence.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/rig/collector.h"
#include "brash_ice_rig/rig/crane.h"

namespace brash_ice_rig {
namespace {

constexpr double kSample = 0.01;
constexpr int kStepsPerSample = 2;

Scenario scenario() {
  Scenario s;  // crane tip between -2 m and 12 m, pole of 6 m, 0.5 m/s, 0.5 m/s²
  s.collector.unfold_duration_s = 2.0;
  return s;
}

PullUpOrder fullOrder() {
  PullUpOrder order;
  order.fold_before_lowering = true;
  order.depth_m = 1.5;
  order.lower_speed_mps = 0.5;
  order.unfold_before_lifting = true;
  order.lift_speed_mps = 0.25;
  order.lift_height_m = 2.0;
  order.hold_duration_s = 1.0;
  return order;
}

/// Crane and collector without ice, driven by a sequence; the hub starts 1 m above the water.
struct Bench {
  explicit Bench(const Scenario& s, bool unfolded = false)
      : pole_m(s.collector.pole_length_m), crane(s.crane, {0.0, 0.0, 1.0 + pole_m}), collector(s.collector, unfolded) {
    fold_target = collector.foldRatio();
  }

  double hub() const { return crane.position().z() - pole_m; }

  Snapshot look() const {
    Snapshot snapshot;
    snapshot.time_s = time_s;
    snapshot.rig.crane_hub_height_m = hub();
    snapshot.rig.fold_ratio = collector.foldRatio();
    snapshot.rig.locked = collector.locked();
    return snapshot;
  }

  /// Until the sequence has finished. @return its stages in order
  std::vector<PullUpStage> run(PullUpSequence& sequence, double timeout_s = 60.0) {
    std::vector<PullUpStage> stages;
    for (const double end_s = time_s + timeout_s; time_s < end_s; time_s += kSample) {
      const PullUpSequence::Drive drive = sequence.step(look(), flags);
      if (stages.empty() || stages.back() != sequence.stage()) stages.push_back(sequence.stage());
      lowest_m = std::min(lowest_m, hub());
      if (sequence.finished()) {
        EXPECT_EQ(drive.hoist_speed_mps, 0.0);
        break;
      }
      if (drive.fold_target) fold_target = *drive.fold_target;
      flags = StatusFlags();
      for (int k = 0; k < kStepsPerSample; ++k) {
        // Nothing moves before the end of settling, whatever is commanded.
        const double speed_mps = time_s < -1e-6 ? 0.0 : drive.hoist_speed_mps;
        crane.step(kSample / kStepsPerSample, {0.0, 0.0, speed_mps}, flags);
        collector.step(kSample / kStepsPerSample, fold_target, 0.0, flags);
      }
    }
    return stages;
  }

  double pole_m;
  Crane crane;
  Collector collector;
  double fold_target;
  double time_s = -0.5;
  StatusFlags flags;
  double lowest_m = 1e9;
};

TEST(PullUpSequence, RunsThroughAllStagesInOrder) {
  Bench bench(scenario(), true);
  PullUpSequence sequence(fullOrder(), scenario().crane, kSample);
  const std::vector<PullUpStage> expected = {PullUpStage::kSettle, PullUpStage::kFold, PullUpStage::kLower,
                                             PullUpStage::kUnfold, PullUpStage::kLift, PullUpStage::kHold,
                                             PullUpStage::kDone};
  EXPECT_EQ(bench.run(sequence), expected) << sequence.failure();
  EXPECT_EQ(bench.collector.foldRatio(), 1.0);
}

TEST(PullUpSequence, ArrivesAtDepthAndHeightWithinTwoMillimetres) {
  for (const double speed_mps : {0.05, 0.2, 0.5}) {
    PullUpOrder order = fullOrder();
    order.lower_speed_mps = order.lift_speed_mps = speed_mps;
    Bench bench(scenario());
    PullUpSequence sequence(order, scenario().crane, kSample);
    bench.run(sequence, 120.0);
    EXPECT_EQ(sequence.stage(), PullUpStage::kDone);
    EXPECT_NEAR(bench.lowest_m, -1.5, 2e-3);
    EXPECT_NEAR(bench.hub(), bench.lowest_m + 2.0, 4e-3);
    EXPECT_EQ(bench.crane.velocity().z(), 0.0);
  }
}

TEST(PullUpSequence, LiftByDurationTakesThatTimeAndHoldToo) {
  PullUpOrder order;
  order.lift_speed_mps = 0.25;
  order.lift_duration_s = 2.0;
  order.hold_duration_s = 3.0;
  Bench bench(scenario(), true);
  PullUpSequence sequence(order, scenario().crane, kSample);
  const std::vector<PullUpStage> expected = {PullUpStage::kSettle, PullUpStage::kLift, PullUpStage::kHold,
                                             PullUpStage::kDone};
  EXPECT_EQ(bench.run(sequence), expected);
  EXPECT_NEAR(bench.time_s, 5.0, 1e-9);  // counted from the end of settling
  // 0.25 m/s x 2 s: what the ramp up loses, the ramp down adds.
  EXPECT_NEAR(bench.hub(), 1.5, 5e-3);
}

TEST(PullUpSequence, JammedArmsEndItAtUnfoldWithTheRemedy) {
  Scenario s = scenario();
  s.collector.fault = FoldFault::kJam;
  s.collector.jam_ratio = 0.4;
  Bench bench(s);
  PullUpSequence sequence(fullOrder(), s.crane, kSample);
  bench.run(sequence);
  EXPECT_EQ(sequence.stage(), PullUpStage::kFailed);
  EXPECT_NE(sequence.failure().find("stage unfold, fold ratio 0.4: fold_jammed"), std::string::npos)
      << sequence.failure();
  EXPECT_NE(sequence.failure().find("Lift the collector out"), std::string::npos) << sequence.failure();
}

TEST(PullUpSequence, ArmsThatDoNotLockEndItBeforeTheLift) {
  Scenario s = scenario();
  s.collector.fault = FoldFault::kNoLock;
  Bench bench(s);
  PullUpSequence sequence(fullOrder(), s.crane, kSample);
  const auto stages = bench.run(sequence);
  EXPECT_EQ(sequence.stage(), PullUpStage::kFailed);
  ASSERT_GE(stages.size(), 2u);
  EXPECT_EQ(stages[stages.size() - 2], PullUpStage::kUnfold);
  EXPECT_NE(sequence.failure().find("fold_unlocked"), std::string::npos) << sequence.failure();
}

TEST(PullUpSequence, UnlockedArmsFromTheStartEndTheLiftTheyCannotCarry) {
  Scenario s = scenario();
  s.collector.fault = FoldFault::kNoLock;
  PullUpOrder order;
  order.lift_speed_mps = 0.1;
  order.lift_duration_s = 5.0;
  Bench bench(s, true);
  PullUpSequence sequence(order, s.crane, kSample);
  bench.run(sequence);
  EXPECT_NE(sequence.failure().find("stage lift"), std::string::npos) << sequence.failure();
}

TEST(PullUpOrder, GoodOnesPass) {
  EXPECT_NO_THROW(checkPullUpOrder(fullOrder(), scenario(), 1.0));
  PullUpOrder order = fullOrder();
  order.lift_height_m = 0.0;
  order.lift_duration_s = 10.0;
  EXPECT_NO_THROW(checkPullUpOrder(order, scenario(), 1.0));
  order.depth_m = order.lower_speed_mps = 0.0;
  EXPECT_NO_THROW(checkPullUpOrder(order, scenario(), -1.5));
}

TEST(PullUpOrder, EachFieldIsRefusedWithNameValueAndRule) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  struct Case {
    double PullUpOrder::*member;
    const char* field;
    double value;
    const char* rule;
  };
  const std::vector<Case> cases = {
      {&PullUpOrder::depth_m, "depth_m", -0.1, "must lie in"},
      {&PullUpOrder::depth_m, "depth_m", nan, "finite"},
      {&PullUpOrder::depth_m, "depth_m", 8.5, "crane.min_height_m"},  // tip 6 m above the hub, not below -2 m
      {&PullUpOrder::lower_speed_mps, "lower_speed_mps", 0.0, "(0, 0.5]"},
      {&PullUpOrder::lower_speed_mps, "lower_speed_mps", 0.6, "(0, 0.5]"},
      {&PullUpOrder::lift_speed_mps, "lift_speed_mps", 0.0, "(0, 0.5]"},
      {&PullUpOrder::lift_speed_mps, "lift_speed_mps", 0.6, "(0, 0.5]"},
      {&PullUpOrder::lift_speed_mps, "lift_speed_mps", inf, "finite"},
      {&PullUpOrder::lift_height_m, "lift_height_m", -1.0, "must lie in"},
      {&PullUpOrder::lift_height_m, "lift_height_m", 0.0, "one of"},
      {&PullUpOrder::lift_height_m, "lift_height_m", 7.6, "crane.max_height_m"},  // from -1.5 m to 12 m - 6 m
      {&PullUpOrder::lift_duration_s, "lift_duration_s", 3601.0, "[0, 3600]"},
      {&PullUpOrder::hold_duration_s, "hold_duration_s", -1.0, "[0, 3600]"},
  };
  for (const Case& c : cases) {
    PullUpOrder order = fullOrder();
    order.*c.member = c.value;
    try {
      checkPullUpOrder(order, scenario(), 1.0);
      ADD_FAILURE() << c.field << " = " << c.value << " passed";
    } catch (const ConfigError& error) {
      EXPECT_EQ(error.key(), c.field);
      EXPECT_NE(error.rule().find(c.rule), std::string::npos) << error.what();
    }
  }
}

TEST(PullUpOrder, RulesThatTieFieldsTogether) {
  PullUpOrder order = fullOrder();
  order.lift_duration_s = 5.0;
  EXPECT_THROW(checkPullUpOrder(order, scenario(), 1.0), ConfigError) << "height and duration";
  order.lift_height_m = 0.0;
  order.lift_duration_s = 31.0;  // 0.25 m/s from -1.5 m: 30 s to 6 m
  EXPECT_THROW(checkPullUpOrder(order, scenario(), 1.0), ConfigError) << "too long for the crane";
  order = fullOrder();
  EXPECT_THROW(checkPullUpOrder(order, scenario(), -1.6), ConfigError) << "hangs deeper already";
  Scenario slow = scenario();
  slow.load_cell.rate_hz = 2.0;
  EXPECT_THROW(checkPullUpOrder(fullOrder(), slow, 1.0), ConfigError) << "commands would be stale between samples";
}

}  // namespace
}  // namespace brash_ice_rig
