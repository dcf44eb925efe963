#include "brash_ice_rig/identify/record_check.h"

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "../output/shell.h"
#include "made_record.h"

namespace brash_ice_rig {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::string listOf(const RecordReport& report) {
  std::string text;
  for (const Finding& finding : report.findings) text += finding.code + ": " + finding.text + "\n";
  return text;
}

const Finding* find(const RecordReport& report, const std::string& code) {
  for (const Finding& finding : report.findings) {
    if (finding.code == code) return &finding;
  }
  return nullptr;
}

/// Expects one finding of that code, and that nothing else is wrong.
void expectOnly(const Record& record, const std::string& code, Severity severity) {
  const RecordReport report = checkRecord(record);
  const Finding* finding = find(report, code);
  ASSERT_NE(finding, nullptr) << "no " << code << " among:\n" << listOf(report);
  EXPECT_EQ(finding->severity, severity) << finding->text;
  EXPECT_FALSE(finding->remedy.empty());
  EXPECT_EQ(report.findings.size(), 1u) << listOf(report);
}

void expectClean(const Record& record) {
  const RecordReport report = checkRecord(record);
  EXPECT_EQ(listOf(report), "");
  EXPECT_EQ(report.usability(), Usability::kYes);
}

Record withForce(Record record, const std::function<double(double force_n, std::size_t i)>& change) {
  for (std::size_t i = 0; i < record.size(); ++i) record.force_n[i] = change(record.force_n[i], i);
  return record;
}

Record scaledForce(double factor) {
  return withForce(makeRecord(), [factor](double force_n, std::size_t) { return factor * force_n; });
}

/// Without the rows of a time span.
Record without(const Record& record, double from_s, double to_s) {
  Record cut = record;
  for (auto* values : {&cut.time_s, &cut.force_n, &cut.hoist_position_m, &cut.hoist_speed_mps}) values->clear();
  cut.line.clear();
  for (std::size_t i = 0; i < record.size(); ++i) {
    if (record.time_s[i] >= from_s && record.time_s[i] < to_s) continue;
    cut.line.push_back(record.line[i]);
    cut.time_s.push_back(record.time_s[i]);
    cut.force_n.push_back(record.force_n[i]);
    cut.hoist_position_m.push_back(record.hoist_position_m[i]);
    cut.hoist_speed_mps.push_back(record.hoist_speed_mps[i]);
  }
  return cut;
}

RecordRecipe stopAndGo() {
  RecordRecipe recipe;
  recipe.stages_s = {9.0, 8.0, 10.0, 8.0, 21.0, 6.0};
  return recipe;
}

// ---- what is good comes out clean

TEST(GoodRecord, ComesOutCleanForAnySeed) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    RecordRecipe recipe;
    recipe.seed = seed;
    expectClean(makeRecord(recipe));
    RecordRecipe stops = stopAndGo();
    stops.seed = seed;
    expectClean(makeRecord(stops));
  }
}

TEST(GoodRecord, ComesOutCleanAtAnyRateNoiseAndResolution) {
  for (const double rate_hz : {4.0, 10.0, 500.0}) {
    for (const double resolution_n : {0.0, 100.0}) {
      for (const double noise_n : {0.0, 150.0}) {
        SCOPED_TRACE(std::to_string(rate_hz) + " Hz, " + std::to_string(resolution_n) + " N, noise " +
                     std::to_string(noise_n));
        RecordRecipe recipe;
        recipe.rate_hz = rate_hz;
        recipe.resolution_n = resolution_n;
        recipe.white_noise_n = recipe.slow_noise_n = noise_n;
        expectClean(makeRecord(recipe));
      }
    }
  }
}

TEST(GoodRecord, ComesOutCleanWithAnotherZeroWeakIceOrWithoutARestAtTheEnd) {
  RecordRecipe tared;
  tared.tare_n = 2052.0;
  expectClean(makeRecord(tared));
  RecordRecipe weak;
  weak.peak_n = 3500.0;
  expectClean(makeRecord(weak));
  RecordRecipe strong;
  strong.peak_n = 80000.0;
  expectClean(makeRecord(strong));
  RecordRecipe long_wait;  // the lift is a fiftieth of the record
  long_wait.rate_hz = 10.0;
  long_wait.quiet_s = 2000.0;
  expectClean(makeRecord(long_wait));
  RecordRecipe open_end;
  open_end.stages_s = {40.0};
  expectClean(makeRecord(open_end));
}

TEST(GoodRecord, ReportTellsItsStagesPeakAndNoise) {
  RecordRecipe recipe = stopAndGo();
  const RecordReport report = checkRecord(makeRecord(recipe));
  const std::vector<std::pair<RecordStageKind, double>> expected = {
      {RecordStageKind::kQuiet, 0.0},    {RecordStageKind::kLifting, 20.0}, {RecordStageKind::kHolding, 29.0},
      {RecordStageKind::kLifting, 37.0}, {RecordStageKind::kHolding, 47.0}, {RecordStageKind::kLifting, 55.0},
      {RecordStageKind::kHolding, 76.0}};
  ASSERT_EQ(report.stages.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(report.stages[i].kind, expected[i].first) << i;
    EXPECT_NEAR(report.stages[i].start_s, expected[i].second, 0.25) << i;
  }
  EXPECT_TRUE(report.has_stops);
  EXPECT_NEAR(report.rate_hz, 50.0, 1e-6);
  EXPECT_NEAR(report.duration_s, 82.0, 0.05);
  EXPECT_NEAR(report.lift_m, 40.0 * 0.052, 0.03);
  EXPECT_NEAR(report.peak_force_n, recipe.peak_n, 0.03 * recipe.peak_n);
  EXPECT_NEAR(report.peak_time_s, 20.0 + 1.2 / 0.052 + 16.0, 3.0);
  EXPECT_EQ(report.resolution_n, 10.0);
  // 40 N white, 60 N slow, of which the straight line takes some.
  EXPECT_NEAR(report.noise_sigma_n, std::hypot(40.0, 60.0), 20.0);
}

// ---- time

TEST(RecordTime, RowsOutOfOrderAreLeftOut) {
  Record record = makeRecord();
  record.time_s[700] = record.time_s[690];
  expectOnly(record, "time_backward", Severity::kDegraded);
  EXPECT_EQ(checkRecord(record).rows.size(), record.size() - 1);
  EXPECT_EQ(find(checkRecord(record), "time_backward")->row, 700u);
}

TEST(RecordTime, ASingleTimeFarOffCostsOneRowOnly) {
  for (const double far_s : {-1.0e9, 1.0e9}) {
    Record record = makeRecord();
    record.time_s[700] = far_s;
    EXPECT_EQ(checkRecord(record).rows.size(), record.size() - 1) << far_s;
    EXPECT_EQ(checkRecord(record).usability(), Usability::kWithLimits) << far_s;
  }
}

TEST(RecordTime, RoundedTimesAreRefused) {
  Record record = makeRecord();
  for (double& time_s : record.time_s) time_s = 0.1 * std::floor(10.0 * time_s + 1.0e-9);
  const RecordReport report = checkRecord(record);
  ASSERT_NE(find(report, "time_repeated"), nullptr) << listOf(report);
  EXPECT_EQ(find(report, "time_repeated")->severity, Severity::kRefuse);
}

TEST(RecordTime, TwoRecordingsInOneFileAreRefused) {
  Record record = makeRecord();
  for (std::size_t i = record.size() / 2; i < record.size(); ++i) record.time_s[i] -= 30.0;
  EXPECT_EQ(checkRecord(record).usability(), Usability::kNo);
  EXPECT_NE(find(checkRecord(record), "time_backward"), nullptr);
}

TEST(RecordTime, RowsWithoutTimeAreLeftOutOrRefused) {
  Record record = makeRecord();
  record.time_s[5] = kNan;
  expectOnly(record, "time_missing", Severity::kDegraded);
  for (std::size_t i = 0; i < record.size(); i += 10) record.time_s[i] = kNan;
  expectOnly(record, "time_missing", Severity::kRefuse);
}

TEST(RecordTime, GapIsFoundWithItsPlaceAndALargeOneRefused) {
  const Record record = makeRecord();
  const Record gap = without(record, 30.0, 32.0);
  expectOnly(gap, "gap", Severity::kDegraded);
  EXPECT_NEAR(gap.time_s[*find(checkRecord(gap), "gap")->row], 32.0, 1.0e-9);
  EXPECT_TRUE(contains(find(checkRecord(gap), "gap")->text, "largest 2.02 s"));
  EXPECT_EQ(find(checkRecord(without(record, 30.0, 40.0)), "gap")->severity, Severity::kRefuse);
}

TEST(RecordTime, UnevenButDenseSamplesAreNoGap) {
  Record record = makeRecord();
  for (std::size_t i = 0; i < record.size(); ++i) record.time_s[i] += i % 3 == 0 ? 0.008 : 0.0;
  expectClean(record);
}

TEST(RecordTime, LowRateIsToldFromAWrongUnit) {
  RecordRecipe recipe;
  recipe.rate_hz = 2.0;
  expectOnly(makeRecord(recipe), "rate_low", Severity::kDegraded);
  recipe.rate_hz = 0.5;
  RecordRecipe slow = recipe;
  slow.quiet_s = 60.0;
  const RecordReport report = checkRecord(makeRecord(slow));
  ASSERT_NE(find(report, "rate_low"), nullptr) << listOf(report);
  EXPECT_EQ(find(report, "rate_low")->severity, Severity::kRefuse);
  EXPECT_EQ(find(report, "time_unit"), nullptr) << listOf(report);
}

// ---- readings

TEST(RecordForce, MissingReadingsAreLeftOutOrRefused) {
  for (const double value : {kNan, std::numeric_limits<double>::infinity()}) {
    Record record = makeRecord();
    for (std::size_t i = 500; i < 504; ++i) record.force_n[i] = value;
    expectOnly(record, "force_missing", Severity::kDegraded);
    EXPECT_EQ(find(checkRecord(record), "force_missing")->row, 500u);
    EXPECT_EQ(checkRecord(record).rows.size(), record.size() - 4);
    for (std::size_t i = 0; i < record.size(); i += 10) record.force_n[i] = value;
    EXPECT_EQ(find(checkRecord(record), "force_missing")->severity, Severity::kRefuse);
  }
}

TEST(RecordForce, ConstantForceIsRefused) {
  expectOnly(withForce(makeRecord(), [](double, std::size_t) { return 12.5; }), "force_constant", Severity::kRefuse);
}

TEST(RecordForce, TooFewRowsAreRefused) {
  Record record = makeRecord();
  expectOnly(without(record, 0.5, 1.0e9), "too_few_samples", Severity::kRefuse);
}

TEST(RecordForce, WrongSignIsRefused) {
  expectOnly(scaledForce(-1.0), "sign", Severity::kRefuse);
}

TEST(RecordForce, WrongUnitIsRecognisedByItsMagnitude) {
  expectOnly(scaledForce(1.0e-3), "force_unit", Severity::kRefuse);            // kN
  expectOnly(scaledForce(1.0 / 9806.65), "force_unit", Severity::kRefuse);     // t
  expectOnly(scaledForce(1.0e3), "force_unit", Severity::kRefuse);             // mN
  expectOnly(scaledForce(1.0 / 9.80665), "force_small", Severity::kDegraded);  // kgf
}

TEST(RecordForce, UnitIsJudgedByTheRigOfTheRecord) {
  // A tank test at a tenth of the size: a thousandth of the force is right there.
  Record record = scaledForce(1.0e-3);
  record.scenario.collector.radius_m *= 0.1;
  record.scenario.collector.rim_height_m *= 0.1;
  record.scenario.field.thickness_m *= 0.1;
  record.scenario.field.spacing_m *= 0.1;
  expectClean(record);
}

TEST(RecordForce, LiftWithoutIceIsNoContact) {
  RecordRecipe recipe;
  recipe.peak_n = 100.0;  // what the pole loses of its buoyancy
  expectOnly(makeRecord(recipe), "no_contact", Severity::kDegraded);
  // All that bears the rig in the water: 20 l of collector and 1.45 m of a pole of 10 cm, 0.0314 m3 at 9.81 kN/m3.
  recipe.peak_n = 308.0;
  expectOnly(makeRecord(recipe), "no_contact", Severity::kDegraded);
  recipe.peak_n = 0.0;
  expectOnly(makeRecord(recipe), "no_contact", Severity::kDegraded);
  recipe.white_noise_n = recipe.slow_noise_n = recipe.resolution_n = 0.0;
  recipe.peak_n = 100.0;
  expectOnly(makeRecord(recipe), "no_contact", Severity::kDegraded);
}

TEST(RecordForce, SaturationIsFoundAtTheTop) {
  for (const double resolution_n : {0.0, 10.0, 100.0}) {
    SCOPED_TRACE(resolution_n);
    RecordRecipe recipe;
    recipe.resolution_n = resolution_n;
    const auto clipped = [&](double limit_n) {
      return withForce(makeRecord(recipe), [=](double force_n, std::size_t) { return std::min(force_n, limit_n); });
    };
    expectOnly(clipped(14500.0), "saturation", Severity::kDegraded);
    EXPECT_TRUE(contains(find(checkRecord(clipped(14500.0)), "saturation")->text, "14500 N"));
    const RecordReport low = checkRecord(clipped(8000.0));
    ASSERT_NE(find(low, "saturation"), nullptr) << listOf(low);
    EXPECT_EQ(find(low, "saturation")->severity, Severity::kRefuse);
  }
}

TEST(RecordForce, FlatTopOfACoarseButFreeRecordIsNoSaturation) {
  RecordRecipe recipe;
  recipe.white_noise_n = recipe.slow_noise_n = 0.0;
  for (const double resolution_n : {5.0, 50.0, 200.0}) {
    recipe.resolution_n = resolution_n;
    const RecordReport report = checkRecord(makeRecord(recipe));
    EXPECT_EQ(find(report, "saturation"), nullptr) << resolution_n << "\n" << listOf(report);
  }
}

TEST(RecordForce, CoarseStepsAreFoundAndLimitTheUse) {
  RecordRecipe recipe;
  recipe.resolution_n = 500.0;
  const Record record = makeRecord(recipe);
  expectOnly(record, "resolution", Severity::kDegraded);
  EXPECT_EQ(checkRecord(record).resolution_n, 500.0);
  recipe.resolution_n = 4.883;  // a converter's step, rounded on its way into the file
  Record rounded = makeRecord(recipe);
  for (double& force_n : rounded.force_n) force_n = 0.001 * std::round(1000.0 * force_n);
  EXPECT_NEAR(checkRecord(rounded).resolution_n, 4.883, 0.01);
  recipe.resolution_n = 0.0;
  EXPECT_EQ(checkRecord(makeRecord(recipe)).resolution_n, 0.0);
}

// ---- motion

TEST(RecordMotion, WrongUnitIsRecognisedByItsMagnitude) {
  const auto scaled = [](double time, double position, double speed, bool given) {
    Record record = makeRecord();
    record.position_given = given;
    for (double& value : record.time_s) value *= time;
    for (double& value : record.hoist_position_m) value *= position;
    for (double& value : record.hoist_speed_mps) value *= speed;
    return record;
  };
  expectOnly(scaled(1.0, 1.0e3, 1.0e3, true), "position_unit", Severity::kRefuse);
  EXPECT_TRUE(contains(checkRecord(scaled(1.0, 1.0e3, 1.0e3, true)).findings[0].text, "in mm"));
  EXPECT_TRUE(contains(checkRecord(scaled(1.0, 1.0e2, 1.0e2, true)).findings[0].text, "in cm"));
  expectOnly(scaled(1.0, 1.0e3, 1.0, true), "position_unit", Severity::kRefuse);
  // A position that comes from a speed in mm/s, or m/min.
  expectOnly(scaled(1.0, 1.0e3, 1.0e3, false), "position_unit", Severity::kRefuse);
  expectOnly(scaled(1.0, 60.0, 60.0, false), "position_unit", Severity::kRefuse);
  // ms with a position and its slope, ms with a position and a speed, ms with a speed and its integral; µs.
  expectOnly(scaled(1.0e3, 1.0, 1.0e-3, true), "time_unit", Severity::kRefuse);
  expectOnly(scaled(1.0e3, 1.0, 1.0, true), "time_unit", Severity::kRefuse);
  expectOnly(scaled(1.0e3, 1.0e3, 1.0, false), "time_unit", Severity::kRefuse);
  EXPECT_TRUE(contains(checkRecord(scaled(1.0e6, 1.0, 1.0e-6, true)).findings[0].text, "µs"));
  expectOnly(scaled(1.0, 1.0, 60.0, true), "speed_disagrees", Severity::kDegraded);
}

TEST(RecordMotion, RecordWithoutLiftIsRefused) {
  Record record = makeRecord();
  for (double& position_m : record.hoist_position_m) position_m = -1.38;
  for (double& speed_mps : record.hoist_speed_mps) speed_mps = 0.0;
  expectOnly(record, "no_lift", Severity::kRefuse);
  record = makeRecord();
  for (double& position_m : record.hoist_position_m) position_m = -position_m;
  for (double& speed_mps : record.hoist_speed_mps) speed_mps = -speed_mps;
  expectOnly(record, "no_lift", Severity::kRefuse);
}

TEST(RecordMotion, RecordShorterThanTheLiftTellsWhatItCovers) {
  RecordRecipe recipe;
  recipe.stages_s = {15.0, 6.0};
  expectOnly(makeRecord(recipe), "too_short", Severity::kDegraded);
  // 0.78 m; rim height and ice thickness make 0.3 m + 1.2 m.
  const std::string text = find(checkRecord(makeRecord(recipe)), "too_short")->text;
  EXPECT_TRUE(contains(text, "first 0.78 m of the 1.5 m")) << text;
  EXPECT_TRUE(contains(text, "perhaps not the peak")) << text;
  recipe.stages_s = {26.0, 6.0};
  EXPECT_TRUE(contains(find(checkRecord(makeRecord(recipe)), "too_short")->text, "not the level after it"));
  recipe.stages_s = {30.0, 6.0};
  expectClean(makeRecord(recipe));
}

TEST(RecordMotion, QuietStretchIsNeededForTheNoise) {
  RecordRecipe recipe;
  recipe.quiet_s = 2.0;
  expectOnly(makeRecord(recipe), "no_quiet", Severity::kDegraded);
  recipe.quiet_s = 0.0;
  expectOnly(makeRecord(recipe), "no_quiet", Severity::kDegraded);
  recipe.quiet_s = 5.0;
  expectClean(makeRecord(recipe));
}

// ---- clock

TEST(RecordClock, OffsetIsFoundAtStopsWithinItsUncertainty) {
  // With the pulse of an accelerated mass, and without: then only the slope of the force tells.
  for (const double mass_kg : {1500.0, 0.0}) {
    double squares = 0.0;
    int count = 0;
    for (const double delay_s : {-0.5, 0.0, 0.13, 1.0}) {
      for (unsigned seed = 1; seed <= 2; ++seed) {
        RecordRecipe recipe = stopAndGo();
        recipe.mass_kg = mass_kg;
        recipe.force_delay_s = delay_s;
        recipe.seed = seed;
        const RecordReport report = checkRecord(makeRecord(recipe));
        ASSERT_TRUE(report.clock.has_value());
        EXPECT_TRUE(report.clock->from_stops);
        if (mass_kg > 0.0) {
          EXPECT_LT(report.clock->sigma_s, 0.1);
        }
        const double error_s = report.clock->offset_s - delay_s;
        EXPECT_LT(std::abs(error_s), mass_kg > 0.0 ? 0.03 : 0.3) << delay_s << ", seed " << seed;
        squares += std::pow(error_s / report.clock->sigma_s, 2);
        ++count;
      }
    }
    EXPECT_LT(std::sqrt(squares / count), 1.5) << "the stated uncertainty is too small, mass " << mass_kg << " kg";
  }
}

TEST(RecordClock, OffsetOfHalfASecondLimitsTheUse) {
  RecordRecipe recipe = stopAndGo();
  recipe.force_delay_s = 0.5;
  expectOnly(makeRecord(recipe), "clock_offset", Severity::kDegraded);
}

TEST(RecordClock, StopsThatTheForceDoesNotShowLimitTheUse) {
  // The stops come when the force is level and buried in noise.
  RecordRecipe recipe;
  recipe.stages_s = {55.0, 8.0, 6.0, 8.0, 6.0, 6.0};
  recipe.white_noise_n = 300.0;
  recipe.slow_noise_n = 300.0;
  Record record = makeRecord(recipe);
  expectOnly(record, "clock_unknown", Severity::kDegraded);
  EXPECT_GT(checkRecord(record).clock->sigma_s, 0.25);
}

TEST(RecordClock, ForceBeforeTheFirstStartIsAnOffsetAndAfterItMayBeWater) {
  RecordRecipe recipe;
  recipe.stages_s = {40.0};
  recipe.force_delay_s = -0.6;
  expectOnly(makeRecord(recipe), "clock_offset", Severity::kDegraded);
  recipe.force_delay_s = 0.6;
  expectOnly(makeRecord(recipe), "late_start", Severity::kNote);
  EXPECT_EQ(checkRecord(makeRecord(recipe)).usability(), Usability::kYes);
}

// ---- what people read

TEST(RecordReport, IsToldWithPlaceRemedyAndUse) {
  Record record = makeRecord();
  record.assumptions = {"no tare_n: 0 assumed"};
  for (std::size_t i = 500; i < 504; ++i) record.force_n[i] = kNan;
  const std::string text = describe("test_10", record, checkRecord(record));
  for (const char* part : {"test_10: record \"made\" (synthetic)", "50 Hz", "quiet 0 to", "lifting", "holding",
                           "assumed", "no tare_n", "force_missing: line 502, t = 10 s: 4 rows",
                           "-> these rows are left out", "usable for identification: with limits"}) {
    EXPECT_TRUE(contains(text, part)) << part << "\n" << text;
  }
}

}  // namespace
}  // namespace brash_ice_rig
