#pragma once

#include <sstream>
#include <string>

#include "brash_ice_rig/config/config_error.h"

namespace brash_ice_rig {

/// What a private parameter of the node may be.
struct ParameterRange {
  double min, max;
  bool zero_allowed = false;  ///< 0 counts as in range although min is higher

  /// NaN and infinity are never contained.
  bool contains(double value) const { return (zero_allowed && value == 0.0) || (value >= min && value <= max); }

  /// For messages.
  std::string rule() const {
    std::ostringstream text;
    text << "must be a number in [" << min << ", " << max << "]" << (zero_allowed ? " or 0" : "");
    return text.str();
  }
};

/// Options of the node that may change while it runs: parameters at its start, dynamic_reconfigure later. None reaches
/// the simulation. Rates count samples per simulated second, but status_rate_hz.
struct LiveOptions {
  double real_time_factor = 1.0;  ///< simulated s per wall s; 0: as fast as it can
  double points_rate_hz = 10.0;   ///< ice/points
  double markers_rate_hz = 10.0;  ///< rig/markers
  double state_rate_hz = 10.0;    ///< crane/state, plug/state
  double joints_rate_hz = 50.0;   ///< joint_states, crane/cmd_vel_out
  double status_rate_hz = 5.0;    ///< sim/status, per wall s
  // Fields of ice/points besides x, y, z.
  bool points_speed = true;
  bool points_pressure = true;
  bool points_plastic_strain = true;
  bool points_damage = true;
  bool points_submerged = true;
  double markers_force_scale_m_per_kn = 0.1;  ///< length of force arrow and bars per force

  /// Names each option once, with its range.
  template <class Self, class Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("real_time_factor", self.real_time_factor, ParameterRange{0.001, 1000.0, true});
    v("points_rate_hz", self.points_rate_hz, ParameterRange{0.1, 1000.0});
    v("markers_rate_hz", self.markers_rate_hz, ParameterRange{0.1, 1000.0});
    v("state_rate_hz", self.state_rate_hz, ParameterRange{0.1, 1000.0});
    v("joints_rate_hz", self.joints_rate_hz, ParameterRange{0.1, 1000.0});
    v("status_rate_hz", self.status_rate_hz, ParameterRange{0.1, 100.0});
    v("points_speed", self.points_speed);
    v("points_pressure", self.points_pressure);
    v("points_plastic_strain", self.points_plastic_strain);
    v("points_damage", self.points_damage);
    v("points_submerged", self.points_submerged);
    v("markers_force_scale_m_per_kn", self.markers_force_scale_m_per_kn, ParameterRange{0.001, 10.0});
  }
};

}  // namespace brash_ice_rig
