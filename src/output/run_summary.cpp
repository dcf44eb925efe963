#include "brash_ice_rig/output/run_summary.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include "brash_ice_rig/output/output_file.h"

namespace brash_ice_rig {
namespace {

std::string hashText(std::uint64_t hash) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

/// JSON has no NaN.
std::string jsonNumber(double value) {
  return std::isfinite(value) ? toText(value) : "null";
}

std::string jsonString(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (static_cast<unsigned char>(c) < 0x20) {
      char escape[7];
      std::snprintf(escape, sizeof escape, "\\u%04x", static_cast<unsigned>(c));
      quoted += escape;
      continue;
    }
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + '"';
}

/// With a fixed number of decimals, or "-" where there is no value.
std::string rounded(double value, int decimals) {
  if (!std::isfinite(value)) return "-";
  // Through an integer, because printf writes the decimal point of the locale.
  const double scale = std::pow(10.0, decimals);
  return toText(std::round(value * scale) / scale);
}

}  // namespace

ForceStatistics::ForceStatistics(double sample_period_s) {
  assert(sample_period_s > 0.0);
  const auto half = static_cast<std::size_t>(std::lround(0.5 * kPeakWindowS / sample_period_s));
  peak_samples_ = 2 * half + 1;
  residual_samples_ = std::max<std::size_t>(1, std::lround(kResidualWindowS / sample_period_s));
}

void ForceStatistics::add(double time_s, double force_n) {
  recent_.push_back({time_s, force_n});
  if (recent_.size() > std::max(peak_samples_, residual_samples_)) recent_.pop_front();
  if (recent_.size() < peak_samples_) return;
  const double mean = meanOfLast(peak_samples_);
  if (std::isnan(peak_n_) || mean > peak_n_) {
    peak_n_ = mean;
    peak_time_s_ = recent_[recent_.size() - 1 - peak_samples_ / 2].time_s;
  }
}

double ForceStatistics::peak() const {
  return recent_.size() < peak_samples_ ? meanOfLast(recent_.size()) : peak_n_;
}

double ForceStatistics::peakTime() const {
  if (recent_.empty()) return std::numeric_limits<double>::quiet_NaN();
  return recent_.size() < peak_samples_ ? 0.5 * (recent_.front().time_s + recent_.back().time_s) : peak_time_s_;
}

double ForceStatistics::residual() const {
  return meanOfLast(std::min(recent_.size(), residual_samples_));
}

double ForceStatistics::meanOfLast(std::size_t count) const {
  // Summed anew each time: a running sum would drift, and one NaN would stay in it for ever.
  double sum = 0.0;
  for (auto sample = recent_.end() - static_cast<std::ptrdiff_t>(count); sample != recent_.end(); ++sample) {
    sum += sample->force_n;
  }
  return sum / static_cast<double>(count);
}

void ForceStatistics::visitState(StateVisitor& visitor) {
  static_assert(sizeof(Sample) == 2 * sizeof(double), "no padding");
  std::vector<Sample> recent;
  if (!visitor.loading()) recent.assign(recent_.begin(), recent_.end());
  visitor.list("recent_n", recent);
  if (recent.size() > std::max(peak_samples_, residual_samples_)) visitor.refuse("there are too many samples");
  recent_.assign(recent.begin(), recent.end());
  visitor("peak_n", peak_n_);
  visitor("peak_time_s", peak_time_s_);
}

std::string statusText(StatusFlags flags, bool interrupted, const std::string& breakdown) {
  std::string text = interrupted ? "interrupted" : "";
  for (const StatusFlag flag : activeFlags(flags)) {
    if (!text.empty()) text += "; ";
    text += std::string(statusName(flag)) + ": " + statusRemedy(flag);
    if (flag == StatusFlag::kNonFinite && !breakdown.empty()) text += " " + breakdown;
  }
  return text.empty() ? "ok" : text;
}

std::string toJson(const RunSummary& summary) {
  const std::vector<std::pair<const char*, std::string>> entries = {
      {"peak_force_n", jsonNumber(summary.peak_force_n)},
      {"peak_time_s", jsonNumber(summary.peak_time_s)},
      {"residual_force_n", jsonNumber(summary.residual_force_n)},
      {"ice_peak_force_n", jsonNumber(summary.ice_peak_force_n)},
      {"ice_residual_force_n", jsonNumber(summary.ice_residual_force_n)},
      {"energy_crane_work_j", jsonNumber(summary.energy_crane_work_j)},
      {"energy_imbalance_ratio", jsonNumber(summary.energy_imbalance_ratio)},
      {"simulated_s", jsonNumber(summary.simulated_s)},
      {"wall_s", jsonNumber(summary.wall_s)},
      {"real_time_factor", jsonNumber(summary.real_time_factor)},
      {"ns_per_particle_step", jsonNumber(summary.ns_per_particle_step)},
      {"active_ratio", jsonNumber(summary.active_ratio)},
      {"particle_count", std::to_string(summary.particle_count)},
      {"step_count", std::to_string(summary.step_count)},
      {"dt_s", jsonNumber(summary.dt_s)},
      {"threads", std::to_string(summary.threads)},
      {"state_hash", jsonString(hashText(summary.state_hash))},
      {"status", jsonString(summary.status)},
  };
  std::string json = "{";
  for (const auto& [key, value] : entries) {
    json += json.size() > 1 ? ",\n  \"" : "\n  \"";
    json += std::string(key) + "\": " + value;
  }
  return json + "\n}\n";
}

std::string describe(const RunSummary& summary) {
  const std::string energy = std::isfinite(summary.energy_crane_work_j)
                                 ? "crane's work    " + rounded(summary.energy_crane_work_j, 0) +
                                       " J, not found again " + rounded(100.0 * summary.energy_imbalance_ratio, 3) +
                                       " %\n"
                                 : "";
  return "peak force      " + rounded(summary.peak_force_n, 0) + " N at " + rounded(summary.peak_time_s, 2) +
         " s (ice alone " + rounded(summary.ice_peak_force_n, 0) + " N)\n" + "residual force  " +
         rounded(summary.residual_force_n, 0) + " N (ice alone " + rounded(summary.ice_residual_force_n, 0) + " N)\n" +
         energy + "simulated       " + rounded(summary.simulated_s, 2) + " s in " + rounded(summary.wall_s, 2) +
         " s, real-time factor " + rounded(summary.real_time_factor, 2) + "\n" + "cost            " +
         rounded(summary.ns_per_particle_step, 0) + " ns per particle and step, " +
         std::to_string(summary.particle_count) + " particles (" + rounded(100.0 * summary.active_ratio, 0) +
         " % of them active in the mean), " + std::to_string(summary.step_count) + " steps of " +
         rounded(1.0e3 * summary.dt_s, 3) + " ms, threads: " + std::to_string(summary.threads) + "\n" +
         "state hash      " + hashText(summary.state_hash) + "\n" + "status          " + summary.status + "\n";
}

}  // namespace brash_ice_rig
