#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace brash_ice_rig {

/// How axes and buttons are numbered.
enum class JoystickLayout {
  kGamepad,  ///< SDL's game controller layout, the same for every gamepad that SDL knows
  kRaw       ///< as the device numbers them; each hat adds two axes behind the others, x then y
};

struct JoystickState {
  std::vector<float> axes;   ///< -1..1, left and up > 0, as joystick drivers of ROS have it; triggers of a gamepad 0..1
  std::vector<int> buttons;  ///< 0 released, 1 pressed
};

/// One joystick through SDL2. One object per process at a time; one thread.
class Joystick {
 public:
  /// @param index  among the joysticks that are connected, from 0
  /// @throws std::runtime_error if SDL fails
  Joystick(int index, JoystickLayout layout);
  ~Joystick();
  Joystick(const Joystick&) = delete;
  Joystick& operator=(const Joystick&) = delete;

  /// Its present state; empty while none is connected. Takes one up that is plugged in later.
  std::optional<JoystickState> read();
  /// Of the device that is open, or what is missing.
  const std::string& description() const { return description_; }

 private:
  struct Device;

  void open();

  int index_;
  JoystickLayout layout_;
  std::string description_;
  std::unique_ptr<Device> device_;
};

}  // namespace brash_ice_rig
