#include "brash_ice_rig/rviz/force_history.h"

#include <cmath>
#include <functional>
#include <limits>

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

constexpr double kWindowS = 60.0;
constexpr double kOffsetS = 3.0;  // ROS time at the test's time 0

/// Samples at 100 Hz over [begin, end) of the test's time.
void feed(ForceHistory& history, double begin_s, double end_s, const std::function<double(double)>& force_n,
          double offset_s = kOffsetS) {
  for (long i = std::lround(100.0 * begin_s); i < std::lround(100.0 * end_s); ++i) {
    const double time_s = 0.01 * static_cast<double>(i);
    history.add(offset_s + time_s, force_n(time_s));
  }
}

TEST(ForceHistory, IsEmptyAtFirstAndUntilItKnowsTheTimeOfTheTest) {
  ForceHistory history(kWindowS);
  EXPECT_FALSE(history.level());
  EXPECT_FALSE(history.peak());
  history.add(10.0, 5.0);
  EXPECT_TRUE(history.curve().empty());
  history.setClock(10.0, 7.0);
  history.add(10.0, 5.0);
  ASSERT_EQ(history.curve().size(), 1u);
  EXPECT_NEAR(history.curve()[0].time_s, 7.05, 1e-9);
}

TEST(ForceHistory, CurveHasTheMeansOfTenthsOfASecond) {
  ForceHistory history(kWindowS);
  history.setClock(kOffsetS, 0.0);
  feed(history, 0.0, 2.0, [](double t) { return 1000.0 * t; });
  const auto curve = history.curve();
  ASSERT_EQ(curve.size(), 20u);
  // Ten samples from t to t + 0.09 s: the mean of a line is its value in their middle.
  EXPECT_NEAR(curve[7].force_n, 745.0, 1e-6);
  EXPECT_NEAR(curve[7].time_s, 0.75, 1e-9);
}

TEST(ForceHistory, LevelIsTheMeanOfTheLastSecond) {
  ForceHistory history(kWindowS);
  history.setClock(kOffsetS, 0.0);
  feed(history, 0.0, 5.0, [](double t) { return t < 4.0 ? 99.0 : 500.0; });
  EXPECT_NEAR(history.level()->force_n, 500.0, 1e-9);
  EXPECT_NEAR(history.level()->time_s, 4.95, 1e-9);
}

TEST(ForceHistory, PeakIsTheLargestMeanOverASecondNotASpike) {
  ForceHistory history(kWindowS);
  history.setClock(kOffsetS, 0.0);
  feed(history, 0.0, 20.0, [](double t) {
    if (std::abs(t - 3.0) < 0.004) return 50000.0;  // one sample: 500 N in the mean
    return t >= 10.0 && t < 11.0 ? 2000.0 : 1000.0;
  });
  EXPECT_NEAR(history.peak()->force_n, 2000.0, 1e-9);
  EXPECT_NEAR(history.peak()->time_s, 10.5, 1e-9);
}

TEST(ForceHistory, PeakCountsFromTheEndOfSettlingAndAfterAWholeSecond) {
  ForceHistory history(kWindowS);
  history.setClock(kOffsetS, 0.0);
  feed(history, -2.0, 0.95, [](double t) { return t < 0.0 ? 9000.0 : 100.0; });
  EXPECT_FALSE(history.peak());
  feed(history, 0.95, 1.2, [](double) { return 100.0; });
  EXPECT_NEAR(history.peak()->force_n, 100.0, 1e-9);
  EXPECT_NEAR(history.peak()->time_s, 0.5, 1e-9);
}

TEST(ForceHistory, ForgetsWhatIsOlderThanTheWindow) {
  ForceHistory history(kWindowS);
  history.setClock(kOffsetS, 0.0);
  feed(history, 0.0, 100.0, [](double t) { return t < 30.0 ? 7000.0 : 1000.0; });
  EXPECT_EQ(history.curve().size(), 600u);
  EXPECT_NEAR(history.curve().front().time_s, 40.05, 1e-9);
  EXPECT_NEAR(history.peak()->force_n, 1000.0, 1e-9);
}

TEST(ForceHistory, SpansAGapInTheSamples) {
  ForceHistory history(kWindowS);
  history.setClock(kOffsetS, 0.0);
  feed(history, 0.0, 2.0, [](double) { return 100.0; });
  feed(history, 10.0, 12.0, [](double) { return 300.0; });
  EXPECT_EQ(history.curve().size(), 40u);
  EXPECT_NEAR(history.peak()->force_n, 300.0, 1e-9);
  EXPECT_NEAR(history.level()->force_n, 300.0, 1e-9);
}

TEST(ForceHistory, CreepOfRosTimeInAPauseIsNoJump) {
  ForceHistory history(kWindowS);
  history.setClock(kOffsetS, 0.0);
  feed(history, 0.0, 5.0, [](double) { return 100.0; });
  for (int i = 1; i < 20000; ++i) history.setClock(kOffsetS + 5.0 + 1e-6 * i, 5.0);
  EXPECT_EQ(history.curve().size(), 50u);
}

TEST(ForceHistory, ResetOfTheRigBeginsAnew) {
  ForceHistory history(kWindowS);
  history.setClock(kOffsetS, 0.0);
  feed(history, 0.0, 5.0, [](double) { return 9000.0; });
  // ROS time goes on; the time of the test is back at -1 s.
  history.setClock(kOffsetS + 5.0, -1.0);
  EXPECT_TRUE(history.curve().empty());
  feed(
      history, -1.0, 2.0, [](double) { return 100.0; }, kOffsetS + 6.0);
  EXPECT_NEAR(history.peak()->force_n, 100.0, 1e-9);
  EXPECT_NEAR(history.curve().front().time_s, -0.95, 1e-9);
}

// After a restart the same scenario has the same offset: only the stamps tell.
TEST(ForceHistory, RestartOfTheNodeBeginsAnewWhicheverTopicComesFirst) {
  for (const bool status_first : {true, false}) {
    ForceHistory history(kWindowS);
    history.setClock(kOffsetS + 20.0, 20.0);
    feed(history, 20.0, 25.0, [](double) { return 9000.0; });
    if (status_first) {
      history.setClock(kOffsetS, 0.0);
    } else {
      history.add(kOffsetS, 100.0);
    }
    EXPECT_TRUE(history.curve().empty()) << status_first;
    if (!status_first) history.setClock(kOffsetS, 0.0);
    feed(history, 0.01, 2.0, [](double) { return 100.0; });
    EXPECT_NEAR(history.peak()->force_n, 100.0, 1e-9) << status_first;
  }
}

TEST(ForceHistory, NotANumberIsLeftOut) {
  ForceHistory history(kWindowS);
  history.setClock(kOffsetS, 0.0);
  feed(history, 0.0, 2.0, [](double) { return 100.0; });
  history.add(kOffsetS + 2.0, std::nan(""));
  history.add(kOffsetS + 2.01, std::numeric_limits<double>::infinity());
  EXPECT_NEAR(history.level()->force_n, 100.0, 1e-9);
  history.clear();
  EXPECT_FALSE(history.level());
}

}  // namespace
}  // namespace brash_ice_rig
