#pragma once

#include <Eigen/Core>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/simulation/status.h"
#include "brash_ice_rig/system/state_visitor.h"

namespace brash_ice_rig {

/// The suspension point. Follows a velocity within limits of speed, acceleration and travel, each axis on its own.
class Crane {
 public:
  Crane(const CraneConfig& config, const Eigen::Vector3d& position_m);

  /// @param wanted_mps  finite
  /// Raises kSpeedLimited when the wanted speed is too high and kTravelLimit when the end of travel holds it back.
  void step(double time_step_s, const Eigen::Vector3d& wanted_mps, StatusFlags& flags);

  const Eigen::Vector3d& position() const { return position_; }
  const Eigen::Vector3d& velocity() const { return velocity_; }
  /// Of the last step, m/s².
  const Eigen::Vector3d& acceleration() const { return acceleration_; }
  /// The wanted velocity after the limits of speed and travel.
  const Eigen::Vector3d& commanded() const { return commanded_; }

  /// Speed from which the crane can still stop within a distance, m/s.
  double stoppingSpeed(double distance_m, double time_step_s) const;

  void visitState(StateVisitor& visitor);

 private:
  CraneConfig config_;
  Eigen::Vector3d low_, high_;
  Eigen::Vector3d position_;
  Eigen::Vector3d velocity_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d acceleration_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d commanded_ = Eigen::Vector3d::Zero();
};

}  // namespace brash_ice_rig
