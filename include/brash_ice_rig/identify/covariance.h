#pragma once

#include <Eigen/Core>

#include "brash_ice_rig/identify/observation.h"

namespace brash_ice_rig {

/// How far the simulator may be from nature where nothing is missing. Amplitudes are shares of the force that the ice
/// exerts there, or of the largest one; lengths are distances that the hoist covers.
struct Discrepancy {
  double share = 0.05;          ///< of the ice's force at the same place
  double share_of_peak = 0.02;  ///< of the largest force, everywhere during the motion
  double length_m = 0.2;        ///< over which it changes
  double rough_share = 0.015;   ///< of the largest force: blocks that rearrange
  double rough_length_m = 0.03;
  double turn_share = 0.05;     ///< of the largest force, where the hoist starts, stops or turns
  double turn_length_m = 0.08;  ///< over which that fades
  double rest_share = 0.01;     ///< of the largest force: how the rig touches the ice before the first motion
  double rest_length_m = 0.05;  ///< over which that is forgotten
  double creep_mps = 0.002;     ///< ice at rest changes as if the hoist covered this
};

/// Matérn's correlation of smoothness 3/2 (Rasmussen and Williams 2006, eq. 4.17): (1 + √3 d/l) exp(−√3 d/l).
/// @param distance  >= 0  @param length  > 0
double computeMatern32(double distance, double length);

/// Noise of the bins, N²: white, plus exponentials of 0.5, 4 and 30 s in equal parts, which together fall like 1/f in
/// between.
Eigen::MatrixXd computeNoiseCovariance(const ForceNoise& noise, const Eigen::VectorXd& time_s);

/// Covariance of what the simulator is off, N².
/// @param ice_force_n  of the simulation, in the bins of the observation
/// @param chaos_n      standard deviation between arrangements of the blocks, as many; counted beside `share`
Eigen::MatrixXd computeDiscrepancyCovariance(const Discrepancy& discrepancy, const Observation& observation,
                                             const Eigen::VectorXd& ice_force_n, const Eigen::VectorXd& chaos_n);

}  // namespace brash_ice_rig
