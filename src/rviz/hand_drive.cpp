#include "brash_ice_rig/rviz/hand_drive.h"

#include <algorithm>
#include <cmath>

namespace brash_ice_rig {

double computeSpeed(double deflection, double full_speed_mps) {
  constexpr double kDeadZone = 0.05;
  if (std::isnan(deflection)) return 0.0;
  const double size = std::min(std::abs(deflection), 1.0);
  if (size <= kDeadZone) return 0.0;
  return std::copysign(full_speed_mps * (size - kDeadZone) / (1.0 - kDeadZone), deflection);
}

std::optional<std::array<double, 3>> HandDrive::next() {
  std::array<double, 3> velocity_mps = {};
  bool held = false;
  for (std::size_t axis = 0; axis < velocity_mps.size(); ++axis) {
    if (!deflection_[axis]) continue;
    held = true;
    velocity_mps[axis] = computeSpeed(*deflection_[axis], full_speed_mps_);
  }
  if (!held && !driving_) return std::nullopt;
  driving_ = held;
  return velocity_mps;
}

}  // namespace brash_ice_rig
