#pragma once

#include <chrono>
#include <cstdint>
#include <deque>

namespace brash_ice_rig {

/// Tells a loop when its next piece of simulated time is due, and measures what was achieved.
/// Deadlines are absolute, so that lateness is made up for; more than kMaxBacklog of it is dropped: simulated time then
/// falls behind wall time, which counts as overload. Takes time points from the caller and never waits by itself.
class RealTimePacer {
 public:
  using Clock = std::chrono::steady_clock;

  static constexpr std::chrono::milliseconds kMaxBacklog{500};
  static constexpr std::chrono::seconds kWindow{2};

  /// @param target_factor  simulated s per wall s, >= 0; 0: never wait
  explicit RealTimePacer(double target_factor) : target_factor_(target_factor) {}

  /// Starts, or starts anew after a rest: the next piece is due now, and nothing is owed.
  void restart(Clock::time_point now);

  /// Books a piece that has just been simulated.
  /// @param simulated_s  its length in simulated time, > 0
  void book(double simulated_s, std::uint64_t steps, Clock::time_point now);

  /// When the next piece is due; in the past if it is late or if there is nothing to wait for.
  Clock::time_point due() const { return due_; }

  double targetFactor() const { return target_factor_; }

  /// Simulated s per wall s over the window, up to now. 0 right after a restart.
  double achievedFactor(Clock::time_point now) const;
  /// Steps per wall s over the window.
  double stepRate(Clock::time_point now) const;
  /// Lateness was dropped within the window.
  bool overloaded(Clock::time_point now) const;

 private:
  struct Mark {
    Clock::time_point wall;
    double simulated_s;
    std::uint64_t steps;
  };

  double ratePerSecond(double amount, Clock::time_point now) const;

  double target_factor_;
  Clock::time_point due_{};
  Clock::time_point last_drop_{};
  bool dropped_ = false;
  double simulated_s_ = 0.0;
  std::uint64_t steps_ = 0;
  std::deque<Mark> marks_;  ///< totals at past instants; the first is the last one before the window
};

}  // namespace brash_ice_rig
