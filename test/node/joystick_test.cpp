#include "brash_ice_rig/teleop/joystick.h"

#include <gtest/gtest.h>

#include <SDL.h>

// SDL's virtual joysticks stand in for the device; older versions have none.
#if SDL_VERSION_ATLEAST(2, 0, 14)

namespace brash_ice_rig {
namespace {

class JoystickBySdl : public testing::Test {
 protected:
  void SetUp() override { ASSERT_EQ(SDL_Init(SDL_INIT_JOYSTICK | SDL_INIT_GAMECONTROLLER), 0) << SDL_GetError(); }
  void TearDown() override { SDL_Quit(); }

  /// Plugs one in behind those that are there. @return its index
  int plugIn(int axes, int buttons, int hats) {
    index_ = SDL_JoystickAttachVirtual(SDL_JOYSTICK_TYPE_GAMECONTROLLER, axes, buttons, hats);
    EXPECT_GE(index_, 0) << SDL_GetError();
    device_ = SDL_JoystickOpen(index_);
    return index_;
  }
  void pullOut() {
    SDL_JoystickClose(device_);
    SDL_JoystickDetachVirtual(index_);
  }

  int index_ = -1;
  SDL_Joystick* device_ = nullptr;
};

TEST_F(JoystickBySdl, RawAxesAreLeftAndUpPositiveAndReachOne) {
  Joystick joystick(plugIn(2, 3, 1), JoystickLayout::kRaw);
  SDL_JoystickSetVirtualAxis(device_, 0, -32768);  // SDL: full left
  SDL_JoystickSetVirtualAxis(device_, 1, 32767);   // SDL: full down
  SDL_JoystickSetVirtualButton(device_, 2, 1);
  SDL_JoystickSetVirtualHat(device_, 0, SDL_HAT_RIGHTUP);
  const auto state = joystick.read();
  ASSERT_TRUE(state);
  EXPECT_EQ(state->axes, (std::vector<float>{1.0f, -1.0f, -1.0f, 1.0f}));
  EXPECT_EQ(state->buttons, (std::vector<int>{0, 0, 1}));
}

TEST_F(JoystickBySdl, GamepadHasTheLayoutOfTheShippedConfiguration) {
  Joystick joystick(plugIn(SDL_CONTROLLER_AXIS_MAX, SDL_CONTROLLER_BUTTON_MAX, 0), JoystickLayout::kGamepad);
  SDL_JoystickSetVirtualAxis(device_, SDL_CONTROLLER_AXIS_LEFTY, -32768);
  SDL_JoystickSetVirtualButton(device_, SDL_CONTROLLER_BUTTON_LEFTSHOULDER, 1);
  const auto state = joystick.read();
  ASSERT_TRUE(state) << joystick.description();
  ASSERT_EQ(state->axes.size(), 6u);
  ASSERT_EQ(state->buttons.size(), 15u);
  EXPECT_EQ(state->axes[1], 1.0f) << "stick up";
  EXPECT_EQ(state->axes[0], 0.0f);
  EXPECT_EQ(state->buttons[9], 1) << "dead-man of gamepad.yaml";
  EXPECT_EQ(state->buttons[0], 0);
}

TEST_F(JoystickBySdl, NoneIsSaidAndOnePluggedInLaterIsTakenUp) {
  const int free_index = SDL_NumJoysticks();
  Joystick joystick(free_index, JoystickLayout::kRaw);
  EXPECT_FALSE(joystick.read());
  EXPECT_NE(joystick.description().find("no joystick"), std::string::npos) << joystick.description();
  ASSERT_EQ(plugIn(1, 1, 0), free_index);
  EXPECT_TRUE(joystick.read());
  pullOut();
  EXPECT_FALSE(joystick.read()) << "pulled out";
}

}  // namespace
}  // namespace brash_ice_rig

#endif
