#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <string>

#include "brash_ice_rig/simulation/snapshot.h"
#include "brash_ice_rig/simulation/status.h"

namespace brash_ice_rig {

/// Peak and residual of a force-time curve, sample by sample, in bounded memory.
class ForceStatistics {
 public:
  /// Length of the running mean whose maximum is the peak, s.
  static constexpr double kPeakWindowS = 1.0;
  /// Length of the mean that is the residual, s.
  static constexpr double kResidualWindowS = 4.5;

  /// @param sample_period_s  time between two add(), > 0
  explicit ForceStatistics(double sample_period_s);

  void add(double time_s, double force_n);

  bool empty() const { return recent_.empty(); }
  /// Largest mean over a window of 1 s (an odd number of samples); over all samples while there are fewer. NaN: none.
  double peak() const;
  /// Time of the middle of that window, s. NaN without samples.
  double peakTime() const;
  /// Mean over the last 4.5 s, or over all samples while there are fewer. NaN without samples.
  double residual() const;

  void visitState(StateVisitor& visitor);

 private:
  struct Sample {
    double time_s, force_n;
  };
  double meanOfLast(std::size_t count) const;

  std::size_t peak_samples_, residual_samples_;
  std::deque<Sample> recent_;
  double peak_n_ = std::numeric_limits<double>::quiet_NaN();
  double peak_time_s_ = std::numeric_limits<double>::quiet_NaN();
};

/// What summary.json holds. Values that do not exist (a run stopped before time 0) are NaN here and null there.
struct RunSummary {
  double peak_force_n = 0.0;  ///< of the load cell's reading, maximum of the centred 1 s mean, time >= 0
  double peak_time_s = 0.0;
  double residual_force_n = 0.0;  ///< mean of the reading over the last 4.5 s before stage done
  double ice_peak_force_n = 0.0;  ///< the same of the ice force alone, > 0 down
  double ice_residual_force_n = 0.0;
  double energy_crane_work_j = std::numeric_limits<double>::quiet_NaN();  ///< from the start; NaN without energy audit
  double energy_imbalance_ratio = std::numeric_limits<double>::quiet_NaN();  ///< share of it that the audit missed
  double simulated_s = 0.0;                                                  ///< settling included
  double wall_s = 0.0;
  double real_time_factor = 0.0;      ///< simulated_s / wall_s
  double ns_per_particle_step = 0.0;  ///< wall time spent in the simulation, per particle and step
  double active_ratio = 1.0;          ///< share of the particles that were computed, mean over the steps
  std::size_t particle_count = 0;
  std::uint64_t step_count = 0;
  double dt_s = 0.0;
  int threads = 0;
  std::uint64_t state_hash = 0;  ///< in the file: 16 hexadecimal digits
  std::string status;            ///< see statusText()
};

/// "ok", or what happened, "; " between: "interrupted" and `name: remedy` of each flag.
/// @param breakdown  of the simulation, behind the remedy of a frozen world
std::string statusText(StatusFlags flags, bool interrupted, const std::string& breakdown = "");

/// One JSON object; keys are the members' names.
std::string toJson(const RunSummary& summary);

/// A few lines for people.
std::string describe(const RunSummary& summary);

}  // namespace brash_ice_rig
