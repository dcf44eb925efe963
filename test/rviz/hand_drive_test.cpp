#include "brash_ice_rig/rviz/hand_drive.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

TEST(HandDrive, SpeedIsLinearBeyondADeadZoneOfATwentieth) {
  EXPECT_EQ(computeSpeed(0.0, 0.2), 0.0);
  EXPECT_EQ(computeSpeed(0.05, 0.2), 0.0);
  EXPECT_EQ(computeSpeed(-0.05, 0.2), 0.0);
  EXPECT_NEAR(computeSpeed(0.525, 0.2), 0.1, 1e-12);  // half way between dead zone and end
  EXPECT_NEAR(computeSpeed(-0.525, 0.2), -0.1, 1e-12);
  EXPECT_DOUBLE_EQ(computeSpeed(1.0, 0.2), 0.2);
  EXPECT_DOUBLE_EQ(computeSpeed(-1.0, 0.2), -0.2);
}

TEST(HandDrive, DeflectionBeyondTheEndOrNoNumberDoesNotSpeedUp) {
  EXPECT_DOUBLE_EQ(computeSpeed(7.0, 0.2), 0.2);
  EXPECT_DOUBLE_EQ(computeSpeed(-std::numeric_limits<double>::infinity(), 0.2), -0.2);
  EXPECT_EQ(computeSpeed(std::nan(""), 0.2), 0.0);
}

TEST(HandDrive, IsSilentUntilAControlIsHeld) {
  HandDrive drive;
  EXPECT_FALSE(drive.next());
  drive.release(HandDrive::kHoist);
  EXPECT_FALSE(drive.next());
}

TEST(HandDrive, RepeatsWhileHeldAndSendsOneZeroOnRelease) {
  HandDrive drive;
  drive.setFullSpeed(0.4);
  drive.hold(HandDrive::kHoist, -1.0);
  for (int i = 0; i < 3; ++i) {
    const auto velocity = drive.next();
    ASSERT_TRUE(velocity);
    EXPECT_EQ(*velocity, (std::array<double, 3>{0.0, 0.0, -0.4}));
  }
  drive.release(HandDrive::kHoist);
  const auto stop = drive.next();
  ASSERT_TRUE(stop);
  EXPECT_EQ(*stop, (std::array<double, 3>{}));
  EXPECT_FALSE(drive.next()) << "one zero, then silence";
}

TEST(HandDrive, ReleaseOfOneAxisLeavesTheOther) {
  HandDrive drive;
  drive.setFullSpeed(0.1);
  drive.hold(HandDrive::kBoomX, 1.0);
  drive.hold(HandDrive::kBoomY, -1.0);
  EXPECT_EQ(*drive.next(), (std::array<double, 3>{0.1, -0.1, 0.0}));
  drive.release(HandDrive::kBoomX);
  EXPECT_EQ(*drive.next(), (std::array<double, 3>{0.0, -0.1, 0.0}));
  drive.releaseAll();
  EXPECT_EQ(*drive.next(), (std::array<double, 3>{}));
  EXPECT_FALSE(drive.next());
}

TEST(HandDrive, HeldInTheMiddleCommandsRest) {
  HandDrive drive;
  drive.hold(HandDrive::kHoist, 0.0);
  EXPECT_TRUE(drive.next());
  EXPECT_TRUE(drive.next()) << "still held: the crane is ours";
}

}  // namespace
}  // namespace brash_ice_rig
