#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "brash_ice_rig/teleop/teleop_command.h"

namespace brash_ice_rig {

/// Which axis drives one direction of the crane.
struct JoyAxis {
  std::size_t axis = 0;        ///< index into Joy.axes
  double max_speed_mps = 0.0;  ///< at axis value +1; < 0 turns the direction round
};

/// What the axes and buttons of a joystick do: a file of config/teleop.
struct JoyConfig {
  std::size_t deadman_button = 0;  ///< the crane moves only while it is held
  std::optional<JoyAxis> hoist, boom_x, boom_y;
  std::optional<std::size_t> fold_button, unfold_button;
  double dead_zone_ratio = 0.1;  ///< deflection that counts as none; what is beyond it begins at zero
  double timeout_s = 0.2;        ///< wall time without a message after which the dead-man counts as let go
};

/// @throws ConfigError naming file, line, key, value and rule
JoyConfig readJoyConfig(const std::string& path);

/// From joystick messages to commands. Commands flow only while the dead-man button is held and messages come; when
/// either ends, one zero is sent, and nothing any more until the button has been seen released and is pressed again. A
/// button that is held when the first message comes therefore moves nothing.
class JoyMapping {
 public:
  explicit JoyMapping(const JoyConfig& config) : config_(config) {}

  /// @param axes  -1..1, left and up > 0, as joystick drivers of ROS have it
  /// @param buttons  0 released
  /// @param now_s  time of any steady clock, s
  /// @return what to send
  TeleopCommand read(const std::vector<float>& axes, const std::vector<int>& buttons, double now_s);

  /// Call some 20 times a second. @return what to send: a zero, if messages have ceased to come
  TeleopCommand update(double now_s);

  /// What the configuration wants and a message with so many axes and buttons lacks; empty: nothing. Such a message
  /// counts as a released dead-man.
  std::string misfit(std::size_t axis_count, std::size_t button_count) const;

 private:
  TeleopCommand release();
  double speed(const std::optional<JoyAxis>& axis, const std::vector<float>& axes) const;

  JoyConfig config_;
  bool armed_ = false;  ///< the dead-man has been released since the last trouble
  bool held_ = false;
  bool fold_pressed_ = false, unfold_pressed_ = false;
  double last_message_s_ = 0.0;
};

}  // namespace brash_ice_rig
