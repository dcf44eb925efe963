#include "brash_ice_rig/identify/measured_force.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/csv.h"

namespace brash_ice_rig {

MeasuredForce::MeasuredForce(std::vector<double> time_s, std::vector<double> force_n)
    : time_s_(std::move(time_s)), force_n_(std::move(force_n)) {
  assert(!time_s_.empty() && force_n_.size() == time_s_.size());
}

MeasuredForce MeasuredForce::read(const std::string& path) {
  CsvTable table = readCsv(path, {"time_s", "force_n"});
  if (!table.columns[0] || !table.columns[1]) throw ConfigError("", "", "must have columns time_s and force_n", path);
  std::vector<double> time, force;
  for (std::size_t row = 0; row < table.line.size(); ++row) {
    const double t = (*table.columns[0])[row], f = (*table.columns[1])[row];
    if (!std::isfinite(t) || !std::isfinite(f)) continue;
    if (!time.empty() && t <= time.back()) {
      throw ConfigError("", "", "line " + std::to_string(table.line[row]) + ": time_s must increase from row to row",
                        path);
    }
    time.push_back(t);
    force.push_back(f);
  }
  if (time.empty()) throw ConfigError("", "", "holds no row with a time and a force", path);
  return {std::move(time), std::move(force)};
}

std::optional<double> MeasuredForce::at(double time_s) const {
  constexpr double kSameTimeS = 1.0e-6;
  const auto next =
      static_cast<std::size_t>(std::lower_bound(time_s_.begin(), time_s_.end(), time_s - kSameTimeS) - time_s_.begin());
  if (next == time_s_.size()) return std::nullopt;
  if (std::abs(time_s_[next] - time_s) <= kSameTimeS) return force_n_[next];
  if (next == 0 || time_s_[next] - time_s_[next - 1] > kLongestGapS) return std::nullopt;
  const double share = (time_s - time_s_[next - 1]) / (time_s_[next] - time_s_[next - 1]);
  return force_n_[next - 1] + share * (force_n_[next] - force_n_[next - 1]);
}

}  // namespace brash_ice_rig
