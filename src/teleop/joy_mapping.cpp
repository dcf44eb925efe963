#include "brash_ice_rig/teleop/joy_mapping.h"

#include <algorithm>
#include <cmath>

#include <yaml-cpp/yaml.h>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/yaml_document.h"

namespace brash_ice_rig {
namespace {

const Range kIndex{0.0, 63.0};
const Range kSpeed{-10.0, 10.0};  // as crane.max_speed_mps, which cuts what is beyond it

std::optional<std::size_t> readButton(const YamlItem& item) {
  if (!item.exists()) return {};
  return static_cast<std::size_t>(item.wholeNumber(kIndex));
}

std::optional<JoyAxis> readAxis(const YamlItem& item) {
  if (!item.exists()) return {};
  const YamlSection section(item, {"axis", "max_speed_mps"});
  JoyAxis axis;
  axis.axis = static_cast<std::size_t>(section["axis"].wholeNumber(kIndex));
  axis.max_speed_mps = section["max_speed_mps"].number(kSpeed);
  return axis;
}

}  // namespace

JoyConfig readJoyConfig(const std::string& path) {
  const YamlItem root{"", "", readYamlMap(path, "what the joystick's axes and buttons do"), path, path};
  const YamlSection section(root, {"deadman_button", "hoist", "boom_x", "boom_y", "fold_button", "unfold_button",
                                   "dead_zone_ratio", "timeout_s"});
  JoyConfig config;
  config.deadman_button = static_cast<std::size_t>(section["deadman_button"].wholeNumber(kIndex));
  config.hoist = readAxis(section["hoist"]);
  config.boom_x = readAxis(section["boom_x"]);
  config.boom_y = readAxis(section["boom_y"]);
  config.fold_button = readButton(section["fold_button"]);
  config.unfold_button = readButton(section["unfold_button"]);
  const YamlItem dead_zone = section["dead_zone_ratio"], timeout = section["timeout_s"];
  if (dead_zone.exists()) config.dead_zone_ratio = dead_zone.number(Range{0.0, 0.9});
  if (timeout.exists()) config.timeout_s = timeout.number(Range{0.05, 2.0});
  for (const char* name : {"fold_button", "unfold_button"}) {
    const auto button = readButton(section[name]);
    if (button == config.deadman_button) section[name].refuse("must differ from deadman_button");
  }
  if (config.fold_button && config.fold_button == config.unfold_button) {
    section["unfold_button"].refuse("must differ from fold_button");
  }
  return config;
}

double JoyMapping::speed(const std::optional<JoyAxis>& axis, const std::vector<float>& axes) const {
  if (!axis) return 0.0;
  const auto deflection = std::clamp(static_cast<double>(axes[axis->axis]), -1.0, 1.0);
  const double beyond = std::abs(deflection) - config_.dead_zone_ratio;
  if (!(beyond > 0.0)) return 0.0;  // NaN: none, too
  return axis->max_speed_mps * std::copysign(beyond / (1.0 - config_.dead_zone_ratio), deflection);
}

TeleopCommand JoyMapping::release() {
  TeleopCommand command;
  if (held_) command.velocity_mps = Eigen::Vector3d::Zero();
  held_ = false;
  return command;
}

TeleopCommand JoyMapping::read(const std::vector<float>& axes, const std::vector<int>& buttons, double now_s) {
  if (now_s - last_message_s_ > config_.timeout_s) armed_ = false;
  last_message_s_ = now_s;
  if (!misfit(axes.size(), buttons.size()).empty()) return release();
  const auto pressed = [&](const std::optional<std::size_t>& button) { return button && buttons[*button] != 0; };
  const bool folds = pressed(config_.fold_button) && !fold_pressed_;
  const bool unfolds = pressed(config_.unfold_button) && !unfold_pressed_;
  fold_pressed_ = pressed(config_.fold_button);
  unfold_pressed_ = pressed(config_.unfold_button);
  if (!pressed(config_.deadman_button)) armed_ = true;
  if (!pressed(config_.deadman_button) || !armed_) return release();

  held_ = true;
  TeleopCommand command;
  command.velocity_mps =
      Eigen::Vector3d(speed(config_.boom_x, axes), speed(config_.boom_y, axes), speed(config_.hoist, axes));
  if (folds) command.fold_target = 0.0;
  if (unfolds) command.fold_target = 1.0;
  return command;
}

TeleopCommand JoyMapping::update(double now_s) {
  if (now_s - last_message_s_ <= config_.timeout_s) return {};
  armed_ = false;
  return release();
}

std::string JoyMapping::misfit(std::size_t axis_count, std::size_t button_count) const {
  std::size_t axes = 0, buttons = config_.deadman_button + 1;
  for (const auto& axis : {config_.hoist, config_.boom_x, config_.boom_y}) {
    if (axis) axes = std::max(axes, axis->axis + 1);
  }
  for (const auto& button : {config_.fold_button, config_.unfold_button}) {
    if (button) buttons = std::max(buttons, *button + 1);
  }
  if (axes <= axis_count && buttons <= button_count) return "";
  return "the joystick has " + std::to_string(axis_count) + " axes and " + std::to_string(button_count) +
         " buttons; the configuration uses " + std::to_string(axes) + " and " + std::to_string(buttons);
}

}  // namespace brash_ice_rig
