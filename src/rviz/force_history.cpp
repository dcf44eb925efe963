#include "brash_ice_rig/rviz/force_history.h"

#include <algorithm>
#include <cmath>

namespace brash_ice_rig {
namespace {

constexpr double kBinS = 0.1;
constexpr std::int64_t kBinsPerSecond = 10;
/// While paused, the node's ROS time creeps on by microseconds. A reset moves it by the length of the test.
constexpr double kJumpS = 5.0e-3;

}  // namespace

ForceHistory::ForceHistory(double window_s) : window_bins_(std::llround(window_s / kBinS)) {}

void ForceHistory::setClock(double stamp_s, double time_s) {
  const double offset_s = stamp_s - time_s;
  if (stamp_s < newest_clock_s_) {
    clear();
    newest_stamp_s_ = 0.0;  // of the node that is gone
  } else if (offset_s_ && std::abs(offset_s - *offset_s_) > kJumpS) {
    clear();
  }
  newest_clock_s_ = stamp_s;
  offset_s_ = offset_s;
}

void ForceHistory::add(double stamp_s, double force_n) {
  if (stamp_s < newest_stamp_s_) {
    clear();
    offset_s_.reset();
    newest_clock_s_ = 0.0;
  }
  newest_stamp_s_ = stamp_s;
  if (!offset_s_ || !std::isfinite(force_n)) return;
  // Stamps are rounded to nanoseconds: a sample at a bin's beginning belongs to it all the same.
  const auto index = static_cast<std::int64_t>(std::floor((stamp_s - *offset_s_) / kBinS + 1.0e-6));
  if (bins_.empty() || bins_.back().index != index) bins_.push_back({index, 0.0, 0});
  bins_.back().force_sum_n += force_n;
  ++bins_.back().count;
  while (bins_.front().index <= index - window_bins_) bins_.pop_front();
}

std::vector<ForcePoint> ForceHistory::curve() const {
  std::vector<ForcePoint> points;
  points.reserve(bins_.size());
  for (const Bin& bin : bins_) {
    points.push_back({kBinS * (static_cast<double>(bin.index) + 0.5), bin.force_sum_n / bin.count});
  }
  return points;
}

std::optional<ForcePoint> ForceHistory::level() const {
  if (bins_.empty()) return std::nullopt;
  const std::int64_t newest = bins_.back().index;
  double sum_n = 0.0;
  int count = 0;
  for (auto bin = bins_.rbegin(); bin != bins_.rend() && bin->index > newest - kBinsPerSecond; ++bin) {
    sum_n += bin->force_sum_n;
    count += bin->count;
  }
  return ForcePoint{kBinS * (static_cast<double>(newest) + 0.5), sum_n / count};
}

std::optional<ForcePoint> ForceHistory::peak() const {
  std::optional<ForcePoint> peak;
  if (bins_.empty()) return peak;
  const std::int64_t begin = std::max<std::int64_t>(0, bins_.front().index);
  double sum_n = 0.0;
  int count = 0;
  std::size_t oldest = 0;
  // The newest bin may still be filling.
  for (std::size_t i = 0; i + 1 < bins_.size(); ++i) {
    if (bins_[i].index < begin) {
      oldest = i + 1;
      continue;
    }
    sum_n += bins_[i].force_sum_n;
    count += bins_[i].count;
    const std::int64_t first = bins_[i].index - kBinsPerSecond + 1;
    for (; bins_[oldest].index < first; ++oldest) {
      sum_n -= bins_[oldest].force_sum_n;
      count -= bins_[oldest].count;
    }
    if (first < begin) continue;
    const double mean_n = sum_n / count;
    if (!peak || mean_n > peak->force_n) {
      peak = ForcePoint{kBinS * (static_cast<double>(first) + 0.5 * kBinsPerSecond), mean_n};
    }
  }
  return peak;
}

}  // namespace brash_ice_rig
