#include "brash_ice_rig/teleop/key_teleop.h"

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

using Keys = std::vector<Key>;

TEST(KeyReader, LettersSignsAndArrows) {
  KeyReader reader;
  EXPECT_EQ(reader.read("ws +-q"),
            (Keys{Key::kHoistUp, Key::kHoistDown, Key::kStop, Key::kFaster, Key::kSlower, Key::kQuit}));
  EXPECT_EQ(reader.read("\x1b[A\x1b[B\x1bOC\x1bOD"),
            (Keys{Key::kHoistUp, Key::kHoistDown, Key::kBoomXPlus, Key::kBoomXMinus}));
}

TEST(KeyReader, SequenceMayComeInPieces) {
  KeyReader reader;
  EXPECT_TRUE(reader.read("\x1b").empty());
  EXPECT_TRUE(reader.read("[").empty());
  EXPECT_EQ(reader.read("A"), Keys{Key::kHoistUp});
}

TEST(KeyReader, ForeignSequencesMeanNothing) {
  KeyReader reader;
  // F5, delete, an arrow with control, mouse, a lone escape before an arrow: none may pass for a letter.
  EXPECT_TRUE(reader.read("\x1b[15~\x1b[3~\x1b[1;5A").empty());
  EXPECT_EQ(reader.read("\x1b\x1b[A"), Keys{Key::kHoistUp});
  EXPECT_TRUE(reader.read("xyz1\t\n").empty());
}

TEST(KeyTeleop, HeldKeyMovesAndReleaseSendsOneZeroThenNothing) {
  KeyTeleop teleop(0.05);
  double now_s = 10.0;
  auto command = teleop.press(Key::kHoistUp, now_s, {});
  ASSERT_TRUE(command.velocity_mps);
  EXPECT_EQ(*command.velocity_mps, Eigen::Vector3d(0.0, 0.0, 0.05));
  // Silent until the terminal begins to repeat, at the slowest after 0.66 s; then 30 a second.
  for (; now_s < 10.66; now_s += 0.05) EXPECT_TRUE(teleop.update(now_s).velocity_mps) << now_s;
  for (; now_s < 12.0; now_s += 0.033) {
    teleop.press(Key::kHoistUp, now_s, {});
    EXPECT_EQ(teleop.update(now_s + 0.02).velocity_mps->z(), 0.05);
  }
  const double released_s = now_s - 0.033;
  int zeros = 0;
  for (; now_s < released_s + 1.0; now_s += 0.02) {
    const auto sent = teleop.update(now_s).velocity_mps;
    if (!sent) continue;
    if (sent->isZero()) {
      ++zeros;
      EXPECT_LE(now_s - released_s, KeyTeleop::kRepeatHoldS + 0.021);
    } else {
      EXPECT_EQ(zeros, 0) << "moves no more after the zero";
    }
  }
  EXPECT_EQ(zeros, 1);
  EXPECT_FALSE(teleop.moving());
}

TEST(KeyTeleop, SingleTapEndsAfterTheFirstHold) {
  KeyTeleop teleop(0.05);
  teleop.press(Key::kHoistDown, 0.0, {});
  EXPECT_FALSE(teleop.update(KeyTeleop::kFirstHoldS - 0.01).velocity_mps->isZero());
  EXPECT_TRUE(teleop.update(KeyTeleop::kFirstHoldS + 0.01).velocity_mps->isZero());
}

TEST(KeyTeleop, StopAndQuitStopAtOnce) {
  for (const Key key : {Key::kStop, Key::kQuit}) {
    KeyTeleop teleop(0.05);
    teleop.press(Key::kHoistUp, 0.0, {});
    EXPECT_TRUE(teleop.press(key, 0.1, {}).velocity_mps->isZero());
    EXPECT_FALSE(teleop.update(0.15).velocity_mps) << "and nothing after it";
  }
  EXPECT_FALSE(KeyTeleop(0.05).press(Key::kQuit, 0.0, {}).velocity_mps) << "whoever did not move it does not stop it";
}

TEST(KeyTeleop, EachDirection) {
  const std::vector<std::pair<Key, Eigen::Vector3d>> cases = {
      {Key::kHoistUp, {0, 0, 1}},     {Key::kHoistDown, {0, 0, -1}}, {Key::kBoomXPlus, {1, 0, 0}},
      {Key::kBoomXMinus, {-1, 0, 0}}, {Key::kBoomYPlus, {0, 1, 0}},  {Key::kBoomYMinus, {0, -1, 0}}};
  for (const auto& [key, direction] : cases) {
    EXPECT_EQ(*KeyTeleop(0.1).press(key, 0.0, {}).velocity_mps, 0.1 * direction);
  }
}

TEST(KeyTeleop, FoldUnfoldAndHoldWhereTheArmsAre) {
  KeyTeleop teleop(0.05);
  EXPECT_EQ(teleop.press(Key::kUnfold, 0.0, 0.2).fold_target, 1.0);
  EXPECT_EQ(teleop.press(Key::kFold, 0.0, 0.2).fold_target, 0.0);
  EXPECT_EQ(teleop.press(Key::kStop, 0.0, 0.37).fold_target, 0.37);
  EXPECT_EQ(teleop.press(Key::kStop, 0.0, 1.2).fold_target, 1.0) << "drooping arms: the largest target there is";
  EXPECT_FALSE(teleop.press(Key::kStop, 0.0, {}).fold_target);
}

TEST(KeyTeleop, SpeedStaysInItsRange) {
  KeyTeleop teleop(0.1);
  teleop.press(Key::kFaster, 0.0, {});
  EXPECT_DOUBLE_EQ(teleop.speed(), 0.125);
  for (int i = 0; i < 50; ++i) teleop.press(Key::kFaster, 0.0, {});
  EXPECT_EQ(teleop.speed(), KeyTeleop::kFastestMps);
  for (int i = 0; i < 50; ++i) teleop.press(Key::kSlower, 0.0, {});
  EXPECT_EQ(teleop.speed(), KeyTeleop::kSlowestMps);
  EXPECT_EQ(KeyTeleop(9.0).speed(), KeyTeleop::kFastestMps);
}

}  // namespace
}  // namespace brash_ice_rig
