#include "brash_ice_rig/teleop/joy_mapping.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

#include <unistd.h>

#include <gtest/gtest.h>

#include "brash_ice_rig/config/config_error.h"

namespace brash_ice_rig {
namespace {

JoyConfig config() {
  JoyConfig c;
  c.deadman_button = 1;
  c.hoist = JoyAxis{0, 0.2};
  c.boom_x = JoyAxis{1, -0.4};
  c.fold_button = 2;
  c.unfold_button = 3;
  c.dead_zone_ratio = 0.2;
  c.timeout_s = 0.3;
  return c;
}

std::vector<int> buttons(bool deadman, bool fold = false, bool unfold = false) {
  return {0, deadman ? 1 : 0, fold ? 1 : 0, unfold ? 1 : 0};
}

/// One whose dead-man button has been seen released.
JoyMapping armed() {
  JoyMapping mapping(config());
  EXPECT_FALSE(mapping.read({0.0f, 0.0f}, buttons(false), 0.0).velocity_mps);
  return mapping;
}

TEST(JoyMapping, StickBeyondTheDeadZoneMovesInProportion) {
  JoyMapping mapping = armed();
  const auto at = [&](float hoist, float boom) {
    return *mapping.read({hoist, boom}, buttons(true), 0.1).velocity_mps;
  };
  EXPECT_EQ(at(0.19f, -0.19f), Eigen::Vector3d(0.0, 0.0, 0.0)) << "within the dead zone";
  EXPECT_NEAR(at(1.0f, 0.0f).z(), 0.2, 1e-12);
  EXPECT_NEAR(at(-1.0f, 0.0f).z(), -0.2, 1e-12);
  EXPECT_NEAR(at(0.6f, 0.0f).z(), 0.1, 1e-8);  // (0.6 - 0.2) / (1 - 0.2) of 0.2 m/s
  EXPECT_NEAR(at(0.0f, 1.0f).x(), -0.4, 1e-12);
  EXPECT_NEAR(at(7.0f, 0.0f).z(), 0.2, 1e-12) << "no more than the full deflection";
}

TEST(JoyMapping, NothingMovesWithoutTheDeadMan) {
  JoyMapping mapping = armed();
  const auto command = mapping.read({1.0f, 1.0f}, buttons(false, true, true), 0.1);
  EXPECT_FALSE(command.velocity_mps);
  EXPECT_FALSE(command.fold_target);
}

TEST(JoyMapping, ReleaseSendsOneZeroThenNothing) {
  JoyMapping mapping = armed();
  ASSERT_FALSE(mapping.read({1.0f, 0.0f}, buttons(true), 0.1).velocity_mps->isZero());
  EXPECT_TRUE(mapping.read({1.0f, 0.0f}, buttons(false), 0.12).velocity_mps->isZero());
  EXPECT_FALSE(mapping.read({1.0f, 0.0f}, buttons(false), 0.14).velocity_mps);
  EXPECT_FALSE(mapping.update(5.0).velocity_mps);
}

TEST(JoyMapping, SilenceOfTheDriverSendsOneZeroAndWantsTheButtonReleasedFirst) {
  JoyMapping mapping = armed();
  mapping.read({1.0f, 0.0f}, buttons(true), 1.0 / 8);
  EXPECT_FALSE(mapping.update(0.4).velocity_mps);
  EXPECT_TRUE(mapping.update(0.45).velocity_mps->isZero());
  EXPECT_FALSE(mapping.update(0.5).velocity_mps);
  EXPECT_FALSE(mapping.read({1.0f, 0.0f}, buttons(true), 0.6).velocity_mps) << "still held after the gap";
  mapping.read({1.0f, 0.0f}, buttons(false), 0.65);
  EXPECT_NEAR(mapping.read({1.0f, 0.0f}, buttons(true), 0.7).velocity_mps->z(), 0.2, 1e-12);
}

TEST(JoyMapping, FirstMessageAfterSilenceStopsWhateverItHolds) {
  for (const bool deadman : {true, false}) {
    JoyMapping mapping = armed();
    mapping.read({1.0f, 0.0f}, buttons(true), 0.1);
    EXPECT_TRUE(mapping.read({1.0f, 0.0f}, buttons(deadman), 0.9).velocity_mps->isZero());
  }
}

TEST(JoyMapping, ButtonThatIsHeldFromTheStartMovesNothing) {
  JoyMapping mapping(config());
  for (double now_s = 0.0; now_s < 1.0; now_s += 0.05) {
    EXPECT_FALSE(mapping.read({1.0f, 0.0f}, buttons(true), now_s).velocity_mps);
  }
}

TEST(JoyMapping, FoldButtonsActOncePerPress) {
  JoyMapping mapping = armed();
  EXPECT_EQ(mapping.read({0.0f, 0.0f}, buttons(true, true), 0.1).fold_target, 0.0);
  EXPECT_FALSE(mapping.read({0.0f, 0.0f}, buttons(true, true), 0.15).fold_target);
  EXPECT_FALSE(mapping.read({0.0f, 0.0f}, buttons(true), 0.2).fold_target);
  EXPECT_EQ(mapping.read({0.0f, 0.0f}, buttons(true, false, true), 0.25).fold_target, 1.0);
}

TEST(JoyMapping, NotANumberCountsAsCentred) {
  JoyMapping mapping = armed();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(mapping.read({nan, nan}, buttons(true), 0.1).velocity_mps->isZero());
}

TEST(JoyMapping, MessageThatLacksAnAxisStopsAndIsExplained) {
  JoyMapping mapping = armed();
  mapping.read({1.0f, 0.0f}, buttons(true), 0.1);
  EXPECT_TRUE(mapping.read({1.0f}, buttons(true), 0.12).velocity_mps->isZero());
  EXPECT_EQ(mapping.misfit(1, 4), "the joystick has 1 axes and 4 buttons; the configuration uses 2 and 4");
  EXPECT_EQ(mapping.misfit(2, 4), "");
}

// ------------------------------------------------------------------------------------------------------------- files

class JoyConfigFile : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(path_); }
  JoyConfig read(const std::string& text) {
    std::ofstream(path_) << text;
    return readJoyConfig(path_);
  }
  const std::string path_ =
      (std::filesystem::temp_directory_path() / ("joy_config_" + std::to_string(getpid()) + ".yaml")).string();
};

TEST_F(JoyConfigFile, TheShippedOnesAreValidAndMoveTheHoist) {
  for (const char* name : {"gamepad", "joystick"}) {
    const JoyConfig c = readJoyConfig(std::string(BRASH_ICE_SOURCE_DIR "/config/teleop/") + name + ".yaml");
    ASSERT_TRUE(c.hoist) << name;
    EXPECT_LE(std::abs(c.hoist->max_speed_mps), 0.5) << "crane.max_speed_mps by default";
    EXPECT_TRUE(c.fold_button && c.unfold_button) << name;
  }
}

TEST_F(JoyConfigFile, EachKeyRefusesABadValue) {
  const std::string good = "deadman_button: 4\n";
  EXPECT_EQ(read(good).deadman_button, 4u);
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"deadman_button: -1\n", "deadman_button"},
      {"deadman_button: 1.5\n", "deadman_button"},
      {"hoist: {axis: 1, max_speed_mps: 0.1}\n", "deadman_button"},
      {good + "hoist: {axis: 64, max_speed_mps: 0.1}\n", "hoist.axis"},
      {good + "boom_x: {axis: 1, max_speed_mps: fast}\n", "boom_x.max_speed_mps"},
      {good + "boom_y: {axis: 1, max_speed_mps: 11}\n", "boom_y.max_speed_mps"},
      {good + "hoist: {axis: 1}\n", "hoist.max_speed_mps"},
      {good + "hoist: {axis: 1, speed: 2}\n", "hoist.speed"},
      {good + "fold_button: x\n", "fold_button"},
      {good + "unfold_button: 4\n", "unfold_button"},
      {good + "fold_button: 2\nunfold_button: 2\n", "unfold_button"},
      {good + "dead_zone_ratio: 1\n", "dead_zone_ratio"},
      {good + "timeout_s: 0\n", "timeout_s"},
      {good + "dead_man: 1\n", "dead_man"},
  };
  for (const auto& [text, key] : cases) {
    try {
      read(text);
      ADD_FAILURE() << text << "passed";
    } catch (const ConfigError& error) {
      EXPECT_EQ(error.key(), key) << error.what();
    }
  }
}

}  // namespace
}  // namespace brash_ice_rig
