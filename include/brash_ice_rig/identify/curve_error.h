#pragma once

#include <Eigen/Core>

#include "brash_ice_rig/identify/observation.h"

namespace brash_ice_rig {

/// How far a curve is from a record: in the mean over all of it, because effects of the load cell show at rest, too;
/// the rest of it since the motion started.
struct CurveError {
  double rmse_n = 0.0;
  double nrmse_ratio = 0.0;             ///< over the record's largest 1 s mean
  double peak_error_n = 0.0;            ///< of the largest 1 s mean, curve less record
  double peak_time_error_s = 0.0;       ///< of its time
  double residual_level_error_n = 0.0;  ///< of the mean of the last 4.5 s
  double max_abs_n = 0.0;
  double ljung_box_p = 0.0;  ///< of the whitened residual, 20 lags
};

/// @param curve_n     in the observation's bins
/// @param covariance  of noise and discrepancy, N², for whitening
CurveError computeError(const Observation& observation, const Eigen::VectorXd& curve_n,
                        const Eigen::MatrixXd& covariance);

}  // namespace brash_ice_rig
