#include "brash_ice_rig/identify/covariance.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "brash_ice_rig/config/broken_line.h"

namespace brash_ice_rig {

double computeMatern32(double distance, double length) {
  const double scaled = std::sqrt(3.0) * distance / length;
  return (1.0 + scaled) * std::exp(-scaled);
}

Eigen::VectorXd computeKnownDiscrepancy(const Discrepancy& d, const Observation& o, double peak_n) {
  Eigen::VectorXd known = Eigen::VectorXd::Zero(o.time_s.size());
  if (d.way_m.empty()) return known;
  for (Eigen::Index i = 0; i < known.size(); ++i) {
    if (o.time_s[i] > 0.0) known[i] = peak_n * valueOfBrokenLine(d.way_m, d.mean_share, o.way_m[i]);
  }
  return known;
}

Discrepancy learnDiscrepancy(const std::vector<std::vector<double>>& ways_m,
                             const std::vector<std::vector<double>>& residual, const Discrepancy& before) {
  constexpr double kGridM = 0.04;
  Discrepancy learned = before;
  learned.way_m.clear();
  learned.mean_share.clear();
  learned.sigma_share.clear();
  double highest = 0.0;
  for (const auto& ways : ways_m) {
    for (const double way : ways) highest = std::max(highest, way);
  }
  const auto cells = static_cast<std::size_t>(highest / kGridM) + 1;
  for (std::size_t cell = 0; cell < cells; ++cell) {
    std::vector<double> means;  // one per lift
    for (std::size_t lift = 0; lift < ways_m.size(); ++lift) {
      double sum = 0.0, count = 0.0;
      for (std::size_t i = 0; i < ways_m[lift].size(); ++i) {
        if (static_cast<std::size_t>(std::max(ways_m[lift][i], 0.0) / kGridM) != cell) continue;
        sum += residual[lift][i];
        count += 1.0;
      }
      if (count > 0.0) means.push_back(sum / count);
    }
    if (means.empty()) continue;
    const double n = static_cast<double>(means.size());
    double mean = 0.0, variance = 0.0;
    for (const double value : means) mean += value / n;
    for (const double value : means) variance += (value - mean) * (value - mean);
    // The mean of n is itself uncertain; one lift alone says nothing about the scatter.
    variance = means.size() > 1 ? variance / (n - 1.0) * (1.0 + 1.0 / n) : before.share * before.share;
    learned.way_m.push_back((static_cast<double>(cell) + 0.5) * kGridM);
    learned.mean_share.push_back(mean);
    learned.sigma_share.push_back(std::sqrt(variance));
  }
  // Few lifts: the scatter over the neighbouring 0.2 m counts as well.
  const std::vector<double> sigma = learned.sigma_share;
  for (std::size_t i = 0; i < sigma.size(); ++i) {
    double sum = 0.0, count = 0.0;
    for (std::size_t j = i < 2 ? 0 : i - 2; j < std::min(i + 3, sigma.size()); ++j) {
      sum += sigma[j] * sigma[j];
      count += 1.0;
    }
    learned.sigma_share[i] = std::sqrt(sum / count);
  }
  return learned;
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

namespace {

/// Distance covered, and time spent since the start in units of distance.
double placeOf(const Discrepancy& d, const Observation& o, Eigen::Index i) {
  return o.travel_m[i] + d.creep_mps * std::max(o.time_s[i], 0.0);
}

}  // namespace

Eigen::MatrixXd computeFormCovariance(const Discrepancy& d, const Observation& o, const Eigen::VectorXd& change_n) {
  const Eigen::Index n = o.time_s.size();
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      const double apart = std::abs(placeOf(d, o, i) - placeOf(d, o, j));
      covariance(i, j) = covariance(j, i) =
          d.form_share * d.form_share * change_n[i] * change_n[j] * computeMatern32(apart, d.form_length_m);
    }
  }
  return covariance;
}

Eigen::MatrixXd computeDiscrepancyCovariance(const Discrepancy& d, const Observation& o,
                                             const Eigen::VectorXd& ice_force_n, const Eigen::VectorXd& chaos_n) {
  const Eigen::Index n = o.time_s.size();
  const double peak = ice_force_n.cwiseAbs().maxCoeff();
  Eigen::VectorXd place(n), smooth(n), rough(n), rest(n), turn = Eigen::VectorXd::Zero(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const bool moving = o.time_s[i] > 0.0;
    place[i] = placeOf(d, o, i);
    const double own = d.way_m.empty() ? d.share * std::abs(ice_force_n[i])
                                       : peak * valueOfBrokenLine(d.way_m, d.sigma_share, o.way_m[i]);
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
