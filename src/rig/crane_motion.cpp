#include "brash_ice_rig/rig/crane_motion.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "brash_ice_rig/config/broken_line.h"
#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/csv.h"
#include "brash_ice_rig/system/hash.h"

namespace brash_ice_rig {

CraneMotion CraneMotion::read(const std::string& path) {
  const auto refuse = [&](const std::string& rule) { return ConfigError("procedure.motion_file", path, rule); };
  const std::vector<std::string> names = {"time_s", "hoist_position_m"};
  const CsvTable table = readCsv(path, names);
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (!table.columns[i]) throw refuse("must have a column " + names[i]);
  }
  const std::vector<double>&time = *table.columns[0], &height = *table.columns[1];
  if (time.size() < 2) throw refuse("must have at least two rows");
  for (std::size_t row = 0; row < time.size(); ++row) {
    const std::string line = "line " + std::to_string(table.line[row]) + ": ";
    if (!std::isfinite(time[row]) || !std::isfinite(height[row])) {
      throw refuse(line + "time_s and hoist_position_m must be numbers");
    }
    if (row == 0 && time[row] < 0.0) {
      throw refuse(line + "time_s must not be negative: 0 is the end of settling and rest");
    }
    if (row > 0 && time[row] <= time[row - 1]) throw refuse(line + "time_s must increase from row to row");
  }
  return {time, height};
}

CraneMotion::CraneMotion(std::vector<double> time_s, std::vector<double> height_m)
    : time_s_(std::move(time_s)), way_m_(std::move(height_m)) {
  assert(time_s_.size() >= 2 && way_m_.size() == time_s_.size());
  const double start = way_m_.front();
  for (double& way : way_m_) way -= start;
}

double CraneMotion::wayAt(double time_s) const {
  return valueOfBrokenLine(time_s_, way_m_, time_s);
}

double CraneMotion::lowest() const {
  return *std::min_element(way_m_.begin(), way_m_.end());
}

double CraneMotion::highest() const {
  return *std::max_element(way_m_.begin(), way_m_.end());
}

double CraneMotion::fastest() const {
  double speed = 0.0;
  for (std::size_t i = 1; i < way_m_.size(); ++i) {
    speed = std::max(speed, std::abs(way_m_[i] - way_m_[i - 1]) / (time_s_[i] - time_s_[i - 1]));
  }
  return speed;
}

std::uint64_t CraneMotion::hash() const {
  Hash hash;
  hash.add(time_s_.data(), time_s_.size() * sizeof(double));
  hash.add(way_m_.data(), way_m_.size() * sizeof(double));
  return hash.value();
}

}  // namespace brash_ice_rig
