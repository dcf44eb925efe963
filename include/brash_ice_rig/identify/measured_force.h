#pragma once

#include <optional>
#include <string>
#include <vector>

namespace brash_ice_rig {

/// A measured force over time, to be read at any time in between.
class MeasuredForce {
 public:
  /// Samples farther apart leave a gap, s.
  static constexpr double kLongestGapS = 0.5;

  /// @param time_s  strictly increasing; at least one, @param force_n  as many; all finite
  MeasuredForce(std::vector<double> time_s, std::vector<double> force_n);

  /// Reads columns time_s and force_n of a CSV file. @throws ConfigError
  static MeasuredForce read(const std::string& path);

  /// At the time of a sample (within 1 µs: stamps are rounded) its very bits, between two a straight line; nothing
  /// outside and in a gap.
  std::optional<double> at(double time_s) const;

  double start() const { return time_s_.front(); }
  double end() const { return time_s_.back(); }

 private:
  std::vector<double> time_s_, force_n_;
};

}  // namespace brash_ice_rig
