#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace brash_ice_rig {

/// The way of a hoist over time, measured or made up, to be driven again: a broken line through its corners.
class CraneMotion {
 public:
  /// Reads a CSV file with columns time_s and hoist_position_m, one corner a row. Only differences of height count:
  /// where the hub starts is up to the scenario. Other columns are ignored.
  /// @throws ConfigError naming procedure.motion_file: what readCsv() refuses, a missing column, fewer than two
  /// corners,
  ///   a cell that is no number, time that does not increase, or that starts before 0
  static CraneMotion read(const std::string& path);

  /// @param time_s    of each corner, at least two, strictly increasing, the first >= 0
  /// @param height_m  as many
  CraneMotion(std::vector<double> time_s, std::vector<double> height_m);

  /// Time of the last corner, s.
  double duration() const { return time_s_.back(); }

  /// Way up since the first corner, m; constant before it and after the last one.
  double wayAt(double time_s) const;

  /// Smallest and largest way, m: <= 0 and >= 0.
  double lowest() const;
  double highest() const;
  /// Largest speed up or down, m/s.
  double fastest() const;

  /// Of all corners: equal for equal motions, wherever they were read from.
  std::uint64_t hash() const;

 private:
  std::vector<double> time_s_, way_m_;
};

}  // namespace brash_ice_rig
