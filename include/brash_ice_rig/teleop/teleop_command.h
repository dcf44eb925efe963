#pragma once

#include <optional>

#include <Eigen/Core>

namespace brash_ice_rig {

/// What a keyboard or joystick sends to the rig. Empty: nothing.
struct TeleopCommand {
  std::optional<Eigen::Vector3d> velocity_mps;  ///< of the crane tip, frame crane_tip
  std::optional<double> fold_target;            ///< 0 folded .. 1 unfolded
};

}  // namespace brash_ice_rig
