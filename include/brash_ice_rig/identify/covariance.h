#pragma once

#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/identify/observation.h"

namespace brash_ice_rig {

/// How far the simulator may be from nature where nothing is missing. Amplitudes are shares of the force that the ice
/// exerts there, or of the largest one; lengths are distances that the hoist covers.
struct Discrepancy {
  /// What reference lifts showed, over the way of the hoist, in shares of the largest force: mean and standard
  /// deviation. Empty without references; else it takes the place of `share`. As many each, the way increasing.
  std::vector<double> way_m, mean_share, sigma_share;

  double share = 0.10;          ///< of the ice's force at the same place
  double share_of_peak = 0.02;  ///< of the largest force, everywhere during the motion
  double length_m = 0.3;        ///< over which it changes
  double rough_share = 0.04;    ///< of the ice's force: blocks that rearrange
  double rough_length_m = 0.03;
  double turn_share = 0.12;     ///< of the largest force, where the hoist starts, stops or turns
  double turn_length_m = 0.15;  ///< over which that fades
  double rest_share = 0.01;     ///< of the largest force: how the rig touches the ice before the first motion
  double rest_length_m = 0.05;  ///< over which that is forgotten
  double form_share = 0.3;      ///< of what an effect does: laws differ
  double form_length_m = 0.06;  ///< over which that changes
  double creep_mps = 0.002;     ///< ice at rest changes as if the hoist covered this
};

/// Matérn's correlation of smoothness 3/2 (Rasmussen and Williams 2006, eq. 4.17): (1 + √3 d/l) exp(−√3 d/l).
/// @param distance  >= 0  @param length  > 0
double computeMatern32(double distance, double length);

/// Noise of the bins, N²: white, plus exponentials of 0.5, 4 and 30 s in equal parts, which together fall like 1/f in
/// between.
Eigen::MatrixXd computeNoiseCovariance(const ForceNoise& noise, const Eigen::VectorXd& time_s);

/// What the simulator is known to be off in the bins of an observation, N: zero without references and before the
/// motion.
/// @param peak_n  largest force of the baseline as given
Eigen::VectorXd computeKnownDiscrepancy(const Discrepancy& discrepancy, const Observation& observation, double peak_n);

/// What lifts without an effect teach. One residual per lift, over its own ways.
/// @param ways_m      of each bin in motion
/// @param residual    record less refitted baseline, over the largest force; as many
/// @param before      whose other terms are kept
Discrepancy learnDiscrepancy(const std::vector<std::vector<double>>& ways_m,
                             const std::vector<std::vector<double>>& residual, const Discrepancy& before);

/// Covariance of what an effect's law may be off, N²: nature's drainage is not the library's.
/// @param change_n  what the effect does to the force
Eigen::MatrixXd computeFormCovariance(const Discrepancy& discrepancy, const Observation& observation,
                                      const Eigen::VectorXd& change_n);

/// Covariance of what the simulator is off, N².
/// @param ice_force_n  of the simulation, in the bins of the observation
/// @param chaos_n      standard deviation between arrangements of the blocks, as many; counted beside `share`
Eigen::MatrixXd computeDiscrepancyCovariance(const Discrepancy& discrepancy, const Observation& observation,
                                             const Eigen::VectorXd& ice_force_n, const Eigen::VectorXd& chaos_n);

}  // namespace brash_ice_rig
