#include "brash_ice_rig/teleop/joystick.h"

#include <stdexcept>

#include <SDL.h>

namespace brash_ice_rig {
namespace {

/// SDL: -32768..32767, right and down > 0.
float toAxis(Sint16 value) {
  return value < 0 ? static_cast<float>(value) / 32768.0f : static_cast<float>(value) / 32767.0f;
}

int toButton(Uint8 value) {
  return value != 0 ? 1 : 0;
}

JoystickState readGamepad(SDL_GameController* controller) {
  JoystickState state;
  for (int axis = 0; axis < SDL_CONTROLLER_AXIS_MAX; ++axis) {
    const auto name = static_cast<SDL_GameControllerAxis>(axis);
    const bool trigger = name == SDL_CONTROLLER_AXIS_TRIGGERLEFT || name == SDL_CONTROLLER_AXIS_TRIGGERRIGHT;
    const float value = toAxis(SDL_GameControllerGetAxis(controller, name));
    state.axes.push_back(trigger ? value : 0.0f - value);  // not -0
  }
  // The fifteen that every version of SDL2 has.
  for (int button = 0; button <= SDL_CONTROLLER_BUTTON_DPAD_RIGHT; ++button) {
    state.buttons.push_back(
        toButton(SDL_GameControllerGetButton(controller, static_cast<SDL_GameControllerButton>(button))));
  }
  return state;
}

JoystickState readRaw(SDL_Joystick* joystick) {
  JoystickState state;
  for (int axis = 0; axis < SDL_JoystickNumAxes(joystick); ++axis) {
    state.axes.push_back(0.0f - toAxis(SDL_JoystickGetAxis(joystick, axis)));
  }
  for (int hat = 0; hat < SDL_JoystickNumHats(joystick); ++hat) {
    const Uint8 value = SDL_JoystickGetHat(joystick, hat);
    const auto pressed = [value](Uint8 direction) { return (value & direction) != 0 ? 1.0f : 0.0f; };
    state.axes.push_back(pressed(SDL_HAT_LEFT) - pressed(SDL_HAT_RIGHT));
    state.axes.push_back(pressed(SDL_HAT_UP) - pressed(SDL_HAT_DOWN));
  }
  for (int button = 0; button < SDL_JoystickNumButtons(joystick); ++button) {
    state.buttons.push_back(toButton(SDL_JoystickGetButton(joystick, button)));
  }
  return state;
}

}  // namespace

struct Joystick::Device {
  SDL_GameController* controller = nullptr;  ///< only with layout gamepad
  SDL_Joystick* joystick = nullptr;          ///< owned by the controller if there is one

  ~Device() {
    if (controller != nullptr) {
      SDL_GameControllerClose(controller);
    } else if (joystick != nullptr) {
      SDL_JoystickClose(joystick);
    }
  }
};

Joystick::Joystick(int index, JoystickLayout layout) : index_(index), layout_(layout) {
  SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");                // Ctrl-C is ROS's
  SDL_SetHint(SDL_HINT_JOYSTICK_ALLOW_BACKGROUND_EVENTS, "1");  // there is no window that could have the focus
  if (SDL_Init(SDL_INIT_JOYSTICK | SDL_INIT_GAMECONTROLLER) != 0) {
    throw std::runtime_error(std::string("SDL: ") + SDL_GetError());
  }
  open();
}

Joystick::~Joystick() {
  device_.reset();
  SDL_QuitSubSystem(SDL_INIT_JOYSTICK | SDL_INIT_GAMECONTROLLER);
}

void Joystick::open() {
  const int count = SDL_NumJoysticks();
  if (index_ >= count) {
    description_ = "no joystick " + std::to_string(index_) + "; connected: " + std::to_string(count);
    return;
  }
  const char* name = SDL_JoystickNameForIndex(index_);
  description_ = name != nullptr ? name : "nameless joystick";
  auto device = std::make_unique<Device>();
  if (layout_ == JoystickLayout::kGamepad) {
    if (SDL_IsGameController(index_) == SDL_FALSE) {
      description_ += ": SDL does not know its layout; use layout raw and a configuration for it";
      return;
    }
    device->controller = SDL_GameControllerOpen(index_);
    if (device->controller != nullptr) device->joystick = SDL_GameControllerGetJoystick(device->controller);
  } else {
    device->joystick = SDL_JoystickOpen(index_);
  }
  if (device->joystick == nullptr) {
    description_ += std::string(": cannot be opened: ") + SDL_GetError();
    return;
  }
  device_ = std::move(device);
}

std::optional<JoystickState> Joystick::read() {
  SDL_JoystickUpdate();  // looks for new devices, too
  if (device_ && SDL_JoystickGetAttached(device_->joystick) == SDL_FALSE) device_.reset();
  if (!device_) open();
  if (!device_) return {};
  return device_->controller != nullptr ? readGamepad(device_->controller) : readRaw(device_->joystick);
}

}  // namespace brash_ice_rig
