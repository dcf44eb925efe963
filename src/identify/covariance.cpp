#include "brash_ice_rig/identify/covariance.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace brash_ice_rig {

double computeMatern32(double distance, double length) {
  const double scaled = std::sqrt(3.0) * distance / length;
  return (1.0 + scaled) * std::exp(-scaled);
}

Eigen::MatrixXd computeNoiseCovariance(const ForceNoise& noise, const Eigen::VectorXd& time_s) {
  constexpr double kTimes[] = {0.5, 4.0, 30.0};
  const Eigen::Index n = time_s.size();
  const double part = noise.slow_n * noise.slow_n / 3.0;
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      double sum = i == j ? noise.white_n * noise.white_n : 0.0;
      for (const double time : kTimes) sum += part * std::exp(-std::abs(time_s[i] - time_s[j]) / time);
      covariance(i, j) = covariance(j, i) = sum;
    }
  }
  return covariance;
}

Eigen::MatrixXd computeDiscrepancyCovariance(const Discrepancy& d, const Observation& o,
                                             const Eigen::VectorXd& ice_force_n, const Eigen::VectorXd& chaos_n) {
  const Eigen::Index n = o.time_s.size();
  const double peak = ice_force_n.cwiseAbs().maxCoeff();
  // Distance covered, and time spent since the start, in units of distance.
  Eigen::VectorXd place(n), smooth(n), rough(n), rest(n), turn = Eigen::VectorXd::Zero(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const bool moving = o.time_s[i] > 0.0;
    place[i] = o.travel_m[i] + d.creep_mps * std::max(o.time_s[i], 0.0);
    const double own = d.share * std::abs(ice_force_n[i]);
    smooth[i] = moving ? std::sqrt(own * own + chaos_n[i] * chaos_n[i]) + d.share_of_peak * peak : 0.0;
    rough[i] = moving ? d.rough_share * std::abs(ice_force_n[i]) : 0.0;
    rest[i] = std::hypot(d.rest_share * peak, chaos_n[0]) * std::exp(-place[i] / d.rest_length_m);
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      const double apart = std::abs(place[i] - place[j]);
      covariance(i, j) = smooth[i] * smooth[j] * computeMatern32(apart, d.length_m) +
                         rough[i] * rough[j] * computeMatern32(apart, d.rough_length_m) + rest[i] * rest[j];
    }
  }
  // Each start, stop and turn has a term of its own, that fades with the distance or the time since.
  for (std::size_t k = 0; k + 1 < o.path.time_s.size(); ++k) {
    const auto speed = [&](std::size_t piece) {
      return (o.path.height_m[piece + 1] - o.path.height_m[piece]) / (o.path.time_s[piece + 1] - o.path.time_s[piece]);
    };
    const double before = k == 0 ? 0.0 : speed(k - 1), after = speed(k);
    if (std::abs(after - before) < 0.5 * std::max(std::abs(after), std::abs(before))) continue;
    double start = 0.0;
    for (std::size_t piece = 0; piece < k; ++piece) {
      start += std::abs(o.path.height_m[piece + 1] - o.path.height_m[piece]);
    }
    start += d.creep_mps * o.path.time_s[k];
    for (Eigen::Index i = 0; i < n; ++i) {
      const double since = place[i] - start;
      // The mean of a bin may begin before the corner that it holds.
      const bool after_corner = o.time_s[i] + 0.5 * kBinS > o.path.time_s[k];
      turn[i] = after_corner ? d.turn_share * peak * std::exp(-std::max(since, 0.0) / d.turn_length_m) : 0.0;
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j <= i; ++j) {
        covariance(i, j) += turn[i] * turn[j] * computeMatern32(std::abs(place[i] - place[j]), d.turn_length_m);
      }
    }
  }
  return covariance.selfadjointView<Eigen::Lower>();
}

}  // namespace brash_ice_rig
