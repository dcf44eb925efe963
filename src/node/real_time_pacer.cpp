#include "brash_ice_rig/node/real_time_pacer.h"

namespace brash_ice_rig {

void RealTimePacer::restart(Clock::time_point now) {
  due_ = now;
  dropped_ = false;
  simulated_s_ = 0.0;
  steps_ = 0;
  marks_.assign(1, Mark{now, 0.0, 0});
}

void RealTimePacer::book(double simulated_s, std::uint64_t steps, Clock::time_point now) {
  simulated_s_ += simulated_s;
  steps_ += steps;
  marks_.push_back({now, simulated_s_, steps_});
  while (marks_.size() > 2 && marks_[1].wall + kWindow < now) marks_.pop_front();

  if (target_factor_ == 0.0) {
    due_ = now;
    return;
  }
  due_ += std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(simulated_s / target_factor_));
  if (due_ + kMaxBacklog < now) {
    due_ = now;
    dropped_ = true;
    last_drop_ = now;
  }
}

double RealTimePacer::ratePerSecond(double amount, Clock::time_point now) const {
  const double wall_s = std::chrono::duration<double>(now - marks_.front().wall).count();
  return wall_s > 0.0 ? amount / wall_s : 0.0;
}

double RealTimePacer::achievedFactor(Clock::time_point now) const {
  return marks_.empty() ? 0.0 : ratePerSecond(simulated_s_ - marks_.front().simulated_s, now);
}

double RealTimePacer::stepRate(Clock::time_point now) const {
  return marks_.empty() ? 0.0 : ratePerSecond(static_cast<double>(steps_ - marks_.front().steps), now);
}

bool RealTimePacer::overloaded(Clock::time_point now) const {
  return dropped_ && now - last_drop_ < kWindow;
}

}  // namespace brash_ice_rig
