#include "brash_ice_rig/rig/collector.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "brash_ice_rig/math/angle.h"
#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {
namespace {

constexpr double kSector = 2.0 * kPi / kArmCount;
/// Arms that did not lock hang down no further than this.
constexpr double kDroopAngle = -60.0 * kPi / 180.0;

}  // namespace

Collector::Collector(const CollectorConfig& config, bool unfolded)
    : config_(config),
      arm_length_(brash_ice_rig::armLength(config)),
      folded_angle_(config.folded_arm_angle_deg * kPi / 180.0),
      unfolded_angle_(unfoldedArmAngle(config)),
      ratio_(unfolded ? 1.0 : 0.0),
      locked_(unfolded && config.fault != FoldFault::kNoLock) {
  updateGeometry();
}

double Collector::armAngle() const {
  return folded_angle_ + ratio_ * (unfolded_angle_ - folded_angle_);
}

Eigen::Vector3d armTipOffset(const CollectorConfig& config, double arm_angle_rad, int arm) {
  const double azimuth = kSector * arm;
  const double reach = armLength(config) * repeatable::cos(arm_angle_rad);
  return {reach * repeatable::cos(azimuth), reach * repeatable::sin(azimuth),
          armLength(config) * repeatable::sin(arm_angle_rad)};
}

Eigen::Vector3d Collector::armTip(int arm) const {
  return armTipOffset(config_, armAngle(), arm);
}

void Collector::step(double time_step_s, double target_ratio, double ice_moment_nm, StatusFlags& flags) {
  const double before = ratio_;
  const double full_step = time_step_s / config_.unfold_duration_s;
  const bool opening = target_ratio >= 1.0;
  double target = std::clamp(target_ratio, 0.0, 1.0);
  if (config_.fault == FoldFault::kJam && ratio_ <= config_.jam_ratio) target = std::min(target, config_.jam_ratio);

  const bool hangs_open = config_.fault == FoldFault::kNoLock && opening && ratio_ >= 1.0;
  if (hangs_open) {
    // The lock would hold the arms against the ice; without it they give way once the ice is too heavy.
    const double holding = config_.unlocked_holding_moment_nm;
    const double share = std::clamp((ice_moment_nm - holding) / (0.1 * holding + 1.0), 0.0, 1.0);
    const double droop_ratio = (kDroopAngle - folded_angle_) / (unfolded_angle_ - folded_angle_);
    ratio_ = std::min(ratio_ + share * full_step, droop_ratio);
  } else {
    ratio_ += std::clamp(target - ratio_, -full_step, full_step);
  }
  locked_ = config_.fault != FoldFault::kNoLock && ratio_ >= 1.0;
  jammed_ = std::clamp(target_ratio, 0.0, 1.0) > target && ratio_ == target;
  if (jammed_) flags.set(StatusFlag::kFoldJammed);
  if (hangs_open) flags.set(StatusFlag::kFoldUnlocked);

  arm_rate_ = (ratio_ - before) * (unfolded_angle_ - folded_angle_) / time_step_s;
  if (ratio_ != before) updateGeometry();
}

void Collector::updateGeometry() {
  const double angle = armAngle();
  const double half_sector = 0.5 * kSector;
  // Middle of the rim edge between the tips at azimuths -half_sector and +half_sector.
  const double x = arm_length_ * repeatable::cos(angle) * repeatable::cos(half_sector);
  const double z = arm_length_ * repeatable::sin(angle);
  const double half_edge = arm_length_ * repeatable::cos(angle) * repeatable::sin(half_sector);
  slant_m_ = std::sqrt(x * x + z * z);
  half_width_ = half_edge / slant_m_;
  slope_cos_ = x / slant_m_;
  slope_sin_ = z / slant_m_;
  middle_turn_x_ = -arm_length_ * repeatable::sin(angle) * repeatable::cos(half_sector);
  middle_turn_z_ = arm_length_ * repeatable::cos(angle);
  edge_turn_ = -arm_length_ * repeatable::sin(angle) * repeatable::sin(half_sector);
}

NetPoint Collector::nearestNetPoint(const Eigen::Vector3d& offset_m) const {
  // The facet whose middle is nearest in azimuth; its frame: x along the middle, y along the rim, z up.
  static const auto kMiddle = [] {
    std::array<Eigen::Vector2d, kArmCount> middle;
    for (int k = 0; k < kArmCount; ++k) {
      middle[static_cast<std::size_t>(k)] << repeatable::cos((k + 0.5) * kSector), repeatable::sin((k + 0.5) * kSector);
    }
    return middle;
  }();
  const Eigen::Vector2d plan = offset_m.head<2>();
  Eigen::Vector2d axis = kMiddle[0];
  for (const auto& candidate : kMiddle) {
    if (candidate.dot(plan) > axis.dot(plan)) axis = candidate;
  }
  const double x = axis.dot(plan);
  const double y = axis.x() * plan.y() - axis.y() * plan.x();

  // Along the slope (u) and across it (w). Beside the triangle the nearest point lies on the line of an arm.
  const double along = x * slope_cos_ + offset_m.z() * slope_sin_;
  double u = std::clamp(along, 0.0, slant_m_);
  double w = y;
  if (std::abs(y) > half_width_ * u) {
    u = std::clamp((along + half_width_ * std::abs(y)) / (1.0 + half_width_ * half_width_), 0.0, slant_m_);
    w = std::copysign(half_width_ * u, y);
  }

  const auto toFrame = [&](double fx, double fy, double fz) {
    return Eigen::Vector3d(axis.x() * fx - axis.y() * fy, axis.y() * fx + axis.x() * fy, fz);
  };
  NetPoint point;
  point.offset_m = toFrame(u * slope_cos_, w, u * slope_sin_);
  point.normal = toFrame(-slope_sin_, 0.0, slope_cos_);
  point.on_rim = along > slant_m_;
  const double share = u / slant_m_;
  const double side = u > 0.0 && half_width_ > 0.0 ? w / (half_width_ * slant_m_) : 0.0;
  point.arm_turn_m = toFrame(share * middle_turn_x_, side * edge_turn_, share * middle_turn_z_);
  point.velocity_mps = arm_rate_ * point.arm_turn_m;
  return point;
}

double Collector::weight() const {
  return mass() * kGravityMps2;
}

double Collector::buoyancy(double hub_height_m, double water_density_kgpm3) const {
  const double tip = arm_length_ * repeatable::sin(armAngle());  // over the hub; below it where the arms droop
  const double lowest = hub_height_m + std::min(tip, 0.0);
  const double collector_share = std::clamp(-lowest / std::max(std::abs(tip), 1.0e-3), 0.0, 1.0);
  const double pole_depth = std::clamp(-hub_height_m, 0.0, config_.pole_length_m);
  const double pole_volume = kPi * config_.pole_radius_m * config_.pole_radius_m * pole_depth;
  return (collector_share * config_.displaced_volume_m3 + pole_volume) * water_density_kgpm3 * kGravityMps2;
}

void Collector::visitState(StateVisitor& visitor) {
  visitor("fold_ratio", ratio_);
  visitor("arm_rate_radps", arm_rate_);
  visitor("locked", locked_);
  visitor("jammed", jammed_);
  if (visitor.loading()) updateGeometry();
}

}  // namespace brash_ice_rig
