#pragma once

#include <array>
#include <optional>

namespace brash_ice_rig {

/// Speed for the deflection of a slider or stick: none within a twentieth around the middle, from there linear up to
/// full_speed_mps at the end.
/// @param deflection  -1..1; beyond it counts as the end, not a number as the middle
double computeSpeed(double deflection, double full_speed_mps);

/// What to send on crane/cmd_vel: the velocity while any control is held, one zero when the last one is let go, and
/// nothing otherwise, so that another commander may drive.
class HandDrive {
 public:
  enum Axis { kBoomX, kBoomY, kHoist };

  /// @param full_speed_mps  speed at the end of a control's travel, m/s, > 0
  void setFullSpeed(double full_speed_mps) { full_speed_mps_ = full_speed_mps; }
  void hold(Axis axis, double deflection) { deflection_[axis] = deflection; }
  void release(Axis axis) { deflection_[axis].reset(); }
  void releaseAll() { deflection_ = {}; }

  /// Velocity of the crane tip to send now, m/s along x, y, z; empty: send nothing.
  std::optional<std::array<double, 3>> next();

 private:
  std::array<std::optional<double>, 3> deflection_;  ///< of the axes that are held
  double full_speed_mps_ = 0.1;
  bool driving_ = false;  ///< the last one sent was not the zero at the end
};

}  // namespace brash_ice_rig
