#include "brash_ice_rig/identify/curve_error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "brash_ice_rig/identify/evidence.h"

namespace brash_ice_rig {

CurveError computeError(const Observation& o, const Eigen::VectorXd& curve, const Eigen::MatrixXd& covariance) {
  constexpr double kMeanWindowS = 1.0, kResidualWindowS = 4.5;
  CurveError e;
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < o.time_s.size(); ++i) {
    if (o.time_s[i] > 0.0) rows.push_back(i);
  }
  const auto n = static_cast<Eigen::Index>(rows.size());
  if (n == 0) return e;
  Eigen::VectorXd record(n), model(n), time(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    record[i] = o.force_n[rows[static_cast<std::size_t>(i)]];
    model[i] = curve[rows[static_cast<std::size_t>(i)]];
    time[i] = o.time_s[rows[static_cast<std::size_t>(i)]];
  }
  const auto window = std::max<Eigen::Index>(1, static_cast<Eigen::Index>(kMeanWindowS / kBinS));
  const auto peakOf = [&](const Eigen::VectorXd& f) {
    std::pair<double, double> peak{-std::numeric_limits<double>::infinity(), 0.0};
    for (Eigen::Index i = 0; i + window <= n; ++i) {
      const double mean = f.segment(i, window).mean();
      if (mean > peak.first) peak = {mean, time.segment(i, window).mean()};
    }
    return peak;
  };
  const Eigen::VectorXd difference = model - record;
  e.rmse_n = std::sqrt((curve - o.force_n).squaredNorm() / static_cast<double>(curve.size()));
  const auto measured = peakOf(record), simulated = peakOf(model);
  e.nrmse_ratio = e.rmse_n / std::abs(measured.first);
  e.peak_error_n = simulated.first - measured.first;
  e.peak_time_error_s = simulated.second - measured.second;
  const auto last = std::min<Eigen::Index>(n, static_cast<Eigen::Index>(kResidualWindowS / kBinS));
  e.residual_level_error_n = difference.tail(last).mean();
  e.max_abs_n = difference.cwiseAbs().maxCoeff();
  const Eigen::LLT<Eigen::MatrixXd> llt(covariance);
  e.ljung_box_p = computeLjungBox(llt.matrixL().solve(o.force_n - curve), kPortmanteauLags);
  return e;
}

}  // namespace brash_ice_rig
