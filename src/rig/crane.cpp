#include "brash_ice_rig/rig/crane.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace brash_ice_rig {

Crane::Crane(const CraneConfig& config, const Eigen::Vector3d& position_m)
    : config_(config),
      low_(position_m.x() - config.max_reach_m, position_m.y() - config.max_reach_m, config.min_height_m),
      high_(position_m.x() + config.max_reach_m, position_m.y() + config.max_reach_m, config.max_height_m),
      position_(position_m) {}

double Crane::stoppingSpeed(double distance_m, double time_step_s) const {
  // Braking at a from v in whole steps covers v²/(2 a) + v dt/2, and up to a dt²/8 more where v is no multiple of a dt.
  const double a = config_.max_acceleration_mps2;
  const double half = 0.5 * a * time_step_s;
  const double distance = distance_m - 0.125 * a * time_step_s * time_step_s;
  return distance > 0.0 ? -half + std::sqrt(half * half + 2.0 * a * distance) : 0.0;
}

void Crane::step(double time_step_s, const Eigen::Vector3d& wanted_mps, StatusFlags& flags) {
  assert(wanted_mps.allFinite());
  const double ramp = config_.max_acceleration_mps2 * time_step_s;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double wanted = wanted_mps[axis];
    double target = std::clamp(wanted, -config_.max_speed_mps, config_.max_speed_mps);
    if (target != wanted) flags.set(StatusFlag::kSpeedLimited);

    const double room_up = stoppingSpeed(high_[axis] - position_[axis], time_step_s);
    const double room_down = stoppingSpeed(position_[axis] - low_[axis], time_step_s);
    const double allowed = std::clamp(target, -room_down, room_up);
    if (allowed != target) flags.set(StatusFlag::kTravelLimit);
    commanded_[axis] = allowed;

    const double before = velocity_[axis];
    velocity_[axis] = std::clamp(allowed, before - ramp, before + ramp);
    acceleration_[axis] = (velocity_[axis] - before) / time_step_s;
    position_[axis] = std::clamp(position_[axis] + time_step_s * velocity_[axis], low_[axis], high_[axis]);
  }
}

void Crane::visitState(StateVisitor& visitor) {
  visitor("position_m", position_);
  visitor("velocity_mps", velocity_);
  visitor("acceleration_mps2", acceleration_);
  visitor("commanded_mps", commanded_);
}

}  // namespace brash_ice_rig
