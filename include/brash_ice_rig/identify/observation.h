#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/identify/record.h"
#include "brash_ice_rig/identify/record_check.h"

namespace brash_ice_rig {

/// Width of the means that the fit works on, s.
constexpr double kBinS = 0.25;

/// The way of the hoist as a broken line, from the start of the first motion on. Corners are rounded to 0.1 s and
/// 5 mm, so that records of the same procedure have the same way and share their simulations.
struct HoistPath {
  std::vector<double> time_s, height_m;  ///< as many, at least 2; both start at 0
};

/// Distance covered at each corner, m, whatever the direction; 0 at the first.
std::vector<double> computeTravel(const HoistPath& path);

/// Noise of the load cell, as the stretch before the lift shows it.
struct ForceNoise {
  double white_n = 0.0;  ///< standard deviation of a bin's mean that no neighbour knows of
  double slow_n = 0.0;   ///< of what is correlated over time, all of it
};

/// A record as the fit sees it: means over bins of kBinS, tare and clock offset taken off.
struct Observation {
  double start_s = 0.0;         ///< time of the record at which the hoist first moves
  double clock_offset_s = 0.0;  ///< that has been taken off
  double clock_sigma_s = 0.0;   ///< of what is left of it
  HoistPath path;
  Eigen::VectorXd time_s;     ///< middle of each bin, 0 at start_s
  Eigen::VectorXd force_n;    ///< tension less that of the empty rig in the water, > 0 when the rig pulls down
  Eigen::MatrixXd lateral_n;  ///< a row per bin, x and y, less their means at rest; empty without lateral channels
  Eigen::VectorXd way_m;      ///< of the hoist since the start, at the middle of the bin
  Eigen::VectorXd travel_m;   ///< distance covered since the start, whatever the direction
  ForceNoise noise;
  bool ice_contact = true;  ///< false: the force never rises as ice would make it rise
};

/// Bins a record from at most 6 s before its first motion to its end.
/// @param report  of checkRecord(); usable
Observation makeObservation(const Record& record, const RecordReport& report);

/// What a simulation says of the same quantity, by time since the start of the motion.
struct SimulatedForce {
  std::vector<double> time_s;         ///< equidistant, from 0 or from the rest before it on
  std::vector<double> force_n;        ///< reading less that of the empty rig at the start
  std::vector<double> empty_force_n;  ///< the same without ice: weight less buoyancy
  std::vector<double> way_m;          ///< of the collector since the start; that of the hoist, but for what stretches
  std::vector<double> force_x_n, force_y_n;
};

/// Reads force.csv of a run.
/// @param rest_s  of which is of interest before time 0, >= 0
/// @throws ConfigError, OutputError if it cannot be read
SimulatedForce readSimulatedForce(const std::string& directory, double rest_s = 0.0);

/// Means of a simulated force over the bins of an observation, N. Before its start it is what it is there, after its
/// end likewise.
/// @param delay_s  by how much the force comes later
Eigen::VectorXd binned(const std::vector<double>& time_s, const std::vector<double>& force_n,
                       const Eigen::VectorXd& bin_time_s, double delay_s = 0.0);

}  // namespace brash_ice_rig
