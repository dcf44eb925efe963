#pragma once

#include <vector>

namespace brash_ice_rig {

struct TimeSpan {
  double start_s = 0.0, end_s = 0.0;
};

/// By how much the force comes after the motion that causes it.
struct ClockOffset {
  double offset_s = 0.0;    ///< > 0: the force is late
  double sigma_s = 0.0;     ///< standard deviation; 0.9 where the record tells nothing
  bool from_stops = false;  ///< false: from the first start only, where water under the ice looks the same as an offset
};

/// Offsets are looked for within this, s; even odds before the record is looked at.
constexpr double kMaxClockOffsetS = 1.5;

/// Finds the offset between the clocks of force and motion from what starts and stops of the hoist do to the force.
///
/// Around each of them, the force is taken for a straight line over time plus what motion does, moved by the offset:
/// way (shearing and lifting more ice: the slope steps with the speed), speed (drag and rate: a step) and acceleration
/// (the mass that hangs on the hoist: a pulse, the sharpest mark of all). That is the cross-correlation of the force's
/// slope with the motion, written as a generalised least-squares fit so that it has an uncertainty: noise is white plus
/// exponentially correlated, of unknown size and share, over which the likelihood is averaged. A jackknife over the
/// windows widens the uncertainty where they contradict each other.
/// @param time_s   strictly increasing, at least 2; the others are finite and as long
/// @param windows  one around each start or stop, at least one
ClockOffset computeClockOffset(const std::vector<double>& time_s, const std::vector<double>& force_n,
                               const std::vector<double>& position_m, const std::vector<double>& speed_mps,
                               const std::vector<TimeSpan>& windows);

}  // namespace brash_ice_rig
