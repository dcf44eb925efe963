#pragma once

#include <Eigen/Core>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/simulation/status.h"
#include "brash_ice_rig/system/state_visitor.h"

namespace brash_ice_rig {

/// Where the net is nearest to a point, and how that spot moves.
struct NetPoint {
  Eigen::Vector3d offset_m;      ///< from the hub
  Eigen::Vector3d velocity_mps;  ///< relative to the hub, from folding
  Eigen::Vector3d normal;        ///< of the facet, unit, towards the inside of the umbrella
  Eigen::Vector3d arm_turn_m;    ///< d offset / d arm angle, for the moment on the arms
  bool on_rim;                   ///< beyond the rim: contact is with its edge, from any side
};

constexpr int kArmCount = 8;

/// Tip of an arm relative to the hub, m. Arm k lies at an azimuth of k times 45°.
/// @param arm_angle_rad  over the horizontal
Eigen::Vector3d armTipOffset(const CollectorConfig& config, double arm_angle_rad, int arm);

/// The umbrella below the pole: hub, eight arms hinged at it, and between them the net as eight flat triangles.
/// Arms lie at azimuths of 0°, 45°, ... and all have the same angle over the horizontal.
class Collector {
 public:
  Collector(const CollectorConfig& config, bool unfolded);

  /// Turns the arms towards the target.
  /// @param ice_moment_nm  of the ice about the hinges, summed over the arms, > 0 opens further. Moves the arms only if
  ///   they are open but did not lock (fault no_lock).
  /// Raises kFoldJammed and kFoldUnlocked.
  void step(double time_step_s, double target_ratio, double ice_moment_nm, StatusFlags& flags);

  /// 0 folded, 1 unfolded, > 1 drooping.
  double foldRatio() const { return ratio_; }
  double armAngle() const;                      ///< rad over the horizontal
  double armRate() const { return arm_rate_; }  ///< rad/s
  double armLength() const { return arm_length_; }
  bool locked() const { return locked_; }
  /// Stuck short of where it was told to go.
  bool jammed() const { return jammed_; }
  /// Offset of an arm's tip from the hub, m.
  Eigen::Vector3d armTip(int arm) const;

  /// @param offset_m  point relative to the hub
  NetPoint nearestNetPoint(const Eigen::Vector3d& offset_m) const;

  /// Weight and buoyancy of collector and pole, N, both > 0, for a height of the hub over the waterline.
  double weight() const;
  double buoyancy(double hub_height_m, double water_density_kgpm3) const;
  double mass() const { return config_.mass_kg + config_.pole_mass_kg; }

  void visitState(StateVisitor& visitor);

 private:
  void updateGeometry();

  CollectorConfig config_;
  double arm_length_, folded_angle_, unfolded_angle_;
  double ratio_;
  double arm_rate_ = 0.0;
  bool locked_, jammed_ = false;
  // Of the facet whose middle lies at azimuth 0, for the present angle:
  double slant_m_ = 0.0;     ///< hub to the middle of the rim edge
  double half_width_ = 0.0;  ///< half rim edge over slant
  double slope_cos_ = 1.0, slope_sin_ = 0.0;
  double middle_turn_x_ = 0.0, middle_turn_z_ = 0.0;  ///< d(rim edge's middle) / d(arm angle)
  double edge_turn_ = 0.0;                            ///< d(half rim edge) / d(arm angle)
};

}  // namespace brash_ice_rig
