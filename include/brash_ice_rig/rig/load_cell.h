#pragma once

#include <random>
#include <string>

#include <Eigen/Core>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/system/state_visitor.h"

namespace brash_ice_rig {

/// Checks a value that is to replace a key of the section load_cell.
/// @param name  of the key, without its section
/// @throws ConfigError as reading a scenario does: `load_cell.noise_n = -1, must lie in [0, 100000]`
void checkLoadCellKey(const std::string& name, double value);

/// Sensor between crane and pole: first-order lag, bias, white noise, resolution, tare, in this order.
class LoadCell {
 public:
  explicit LoadCell(const LoadCellConfig& config);

  /// Follows the true force (of the crane on the rig, N; z is the tension) with the sensor's lag. Call every step.
  void step(double time_step_s, const Eigen::Vector3d& force_n);

  /// Draws the next reading. Call once per sample period.
  void sample();

  /// Subtracts the present force, as the sensor sees it without noise, from the next sample on.
  void tare();

  /// Standard deviation of the noise, N, from the next sample on.
  void setNoise(double noise_n) { config_.noise_n = noise_n; }
  double noise() const { return config_.noise_n; }
  /// Step between two readings, N, from the next sample on; 0: continuous.
  void setResolution(double resolution_n) { config_.resolution_n = resolution_n; }
  double resolution() const { return config_.resolution_n; }

  /// The last sample, N.
  const Eigen::Vector3d& reading() const { return reading_; }
  /// What tare() subtracts, N.
  const Eigen::Vector3d& tareOffset() const { return tare_; }

  void visitState(StateVisitor& visitor);

 private:
  LoadCellConfig config_;
  std::mt19937_64 generator_;
  bool started_ = false;
  Eigen::Vector3d lagged_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d reading_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d tare_ = Eigen::Vector3d::Zero();
};

}  // namespace brash_ice_rig
