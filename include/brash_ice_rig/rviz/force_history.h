#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

namespace brash_ice_rig {

struct ForcePoint {
  double time_s;  ///< of the test; 0 is the end of settling and rest
  double force_n;
};

/// The load cell's reading over the last minutes, over the time of the test, in bounded memory. Samples are averaged
/// over 0.1 s. Begins anew when time jumps: the rig was reset, went back to a checkpoint, or its node was restarted.
class ForceHistory {
 public:
  /// @param window_s  how long a sample is kept, s, > 1
  explicit ForceHistory(double window_s);

  /// ROS time and the time of the test at one instant (sim/status). Samples before the first one are dropped, for
  /// their time in the test is not known.
  void setClock(double stamp_s, double time_s);
  /// @param stamp_s  ROS time; @param force_n  is ignored if not finite
  void add(double stamp_s, double force_n);
  /// Forgets samples, not the clock.
  void clear() { bins_.clear(); }

  /// Oldest first.
  std::vector<ForcePoint> curve() const;
  /// Mean of the last second, at the newest sample; of what there is while that is less. Empty without samples.
  std::optional<ForcePoint> level() const;
  /// Largest mean over one second that begins at time 0 or later, at its middle: peak_force_n of sim/status, but of the
  /// window only and to 0.1 s. Empty before such a second is over.
  std::optional<ForcePoint> peak() const;

 private:
  struct Bin {
    std::int64_t index;  ///< time of its beginning in 0.1 s
    double force_sum_n;
    int count;
  };

  std::int64_t window_bins_;
  std::deque<Bin> bins_;
  std::optional<double> offset_s_;  ///< ROS time less time of the test
  double newest_stamp_s_ = 0.0, newest_clock_s_ = 0.0;
};

}  // namespace brash_ice_rig
