#include "brash_ice_rig/node/real_time_pacer.h"

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

using Clock = RealTimePacer::Clock;
using std::chrono::milliseconds;

const Clock::time_point kStart = Clock::time_point() + std::chrono::hours(1);

TEST(RealTimePacer, DeadlinesDoNotDrift) {
  RealTimePacer pacer(0.5);
  pacer.restart(kStart);
  for (int i = 0; i < 1000; ++i) {
    pacer.book(0.01, 4, pacer.due() + milliseconds(3));  // each piece ends 3 ms late
  }
  EXPECT_NEAR(std::chrono::duration<double>(pacer.due() - kStart).count(), 1000 * 0.01 / 0.5, 1e-6);
}

TEST(RealTimePacer, ShortLatenessIsMadeUp) {
  RealTimePacer pacer(1.0);
  pacer.restart(kStart);
  pacer.book(0.01, 4, kStart + milliseconds(400));
  EXPECT_EQ(pacer.due(), kStart + milliseconds(10));
  EXPECT_FALSE(pacer.overloaded(kStart + milliseconds(400)));
}

TEST(RealTimePacer, LongLatenessIsDroppedAndCountsAsOverload) {
  RealTimePacer pacer(1.0);
  pacer.restart(kStart);
  const auto late = kStart + milliseconds(700);
  pacer.book(0.01, 4, late);
  EXPECT_EQ(pacer.due(), late);
  EXPECT_TRUE(pacer.overloaded(late));
  EXPECT_FALSE(pacer.overloaded(late + RealTimePacer::kWindow));
}

TEST(RealTimePacer, FactorZeroNeverWaits) {
  RealTimePacer pacer(0.0);
  pacer.restart(kStart);
  for (int i = 1; i <= 10; ++i) {
    const auto now = kStart + milliseconds(i);
    pacer.book(0.01, 4, now);
    EXPECT_LE(pacer.due(), now);
    EXPECT_FALSE(pacer.overloaded(now));
  }
}

TEST(RealTimePacer, AchievedFactorIsThatOfTheLastTwoSeconds) {
  RealTimePacer pacer(1.0);
  pacer.restart(kStart);
  auto now = kStart;
  for (int i = 0; i < 500; ++i) pacer.book(0.01, 4, now += milliseconds(10));
  EXPECT_NEAR(pacer.achievedFactor(now), 1.0, 0.01);
  EXPECT_NEAR(pacer.stepRate(now), 400.0, 4.0);
  for (int i = 0; i < 500; ++i) pacer.book(0.01, 4, now += milliseconds(40));
  EXPECT_NEAR(pacer.achievedFactor(now), 0.25, 0.01);
}

TEST(RealTimePacer, RestartOwesNothing) {
  RealTimePacer pacer(1.0);
  pacer.restart(kStart);
  pacer.book(0.01, 4, kStart + milliseconds(900));
  const auto later = kStart + std::chrono::seconds(100);
  pacer.restart(later);
  EXPECT_EQ(pacer.due(), later);
  EXPECT_FALSE(pacer.overloaded(later));
  EXPECT_EQ(pacer.achievedFactor(later), 0.0);
}

}  // namespace
}  // namespace brash_ice_rig
