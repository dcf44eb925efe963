#include "brash_ice_rig/identify/clock_offset.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <utility>

namespace brash_ice_rig {
namespace {

/// What the model of the force around a stop leaves open, s: ice relaxes, ropes swing. On simulated stop-and-go lifts
/// the error is half of it.
constexpr double kModelSigmaS = 0.05;

struct Motion {
  const std::vector<double>& time_s;
  const std::vector<double>& position_m;
  const std::vector<double>& speed_mps;
  double slope_half_s;  ///< half of the time over which the slope of the speed is taken
};

double interpolate(const std::vector<double>& t, const std::vector<double>& y, double at) {
  const auto right = std::lower_bound(t.begin(), t.end(), at);
  if (right == t.begin()) return y.front();
  if (right == t.end()) return y.back();
  const std::size_t k = static_cast<std::size_t>(right - t.begin());
  return y[k - 1] + (at - t[k - 1]) / (t[k] - t[k - 1]) * (y[k] - y[k - 1]);
}

/// Means of the force over 0.05 s: more samples would not make the timing better, only the work longer.
struct ForceMeans {
  std::vector<double> time_s, force_n;
};

ForceMeans forceMeans(const std::vector<double>& time_s, const std::vector<double>& force_n, const TimeSpan& window) {
  constexpr double kMeanS = 0.05;
  ForceMeans means;
  std::vector<double> counts;
  const auto at = [&](double time) {
    return static_cast<std::size_t>(std::lower_bound(time_s.begin(), time_s.end(), time) - time_s.begin());
  };
  const std::size_t last = at(window.end_s);
  double start_s = 0.0;
  for (std::size_t i = at(window.start_s); i < last; ++i) {
    // A thousandth: times are rounded.
    if (counts.empty() || time_s[i] - start_s > 0.999 * kMeanS) {
      start_s = time_s[i];
      means.time_s.push_back(0.0);
      means.force_n.push_back(0.0);
      counts.push_back(0.0);
    }
    means.time_s.back() += time_s[i];
    means.force_n.back() += force_n[i];
    counts.back() += 1.0;
  }
  for (std::size_t k = 0; k < counts.size(); ++k) {
    means.time_s[k] /= counts[k];
    means.force_n[k] /= counts[k];
  }
  return means;
}

/// Log-likelihood of each offset from the force in one window, up to a constant.
Eigen::ArrayXd offsetLogLikelihood(const Motion& motion, const ForceMeans& means,
                                   const std::vector<double>& offsets_s) {
  const Eigen::Index size = static_cast<Eigen::Index>(means.time_s.size());
  const Eigen::Index offset_count = static_cast<Eigen::Index>(offsets_s.size());
  constexpr Eigen::Index kParameters = 5;
  if (size < 3 * kParameters) return Eigen::ArrayXd::Zero(offset_count);
  Eigen::MatrixXd force(size, 1);
  for (Eigen::Index k = 0; k < size; ++k) force(k, 0) = means.force_n[static_cast<std::size_t>(k)];
  force.array() -= force.mean();

  std::vector<Eigen::MatrixXd> models;
  for (const double offset_s : offsets_s) {
    Eigen::MatrixXd& model = models.emplace_back(size, kParameters);
    for (Eigen::Index k = 0; k < size; ++k) {
      const double t = means.time_s[static_cast<std::size_t>(k)];
      const auto speed = [&](double at) { return interpolate(motion.time_s, motion.speed_mps, at - offset_s); };
      model.row(k) << 1.0, t - means.time_s.front(), interpolate(motion.time_s, motion.position_m, t - offset_s),
          speed(t), (speed(t + motion.slope_half_s) - speed(t - motion.slope_half_s)) / (2.0 * motion.slope_half_s);
    }
    model.col(2).array() -= model.col(2).mean();
  }

  // Correlation time, s, and white share of the variance.
  constexpr std::pair<double, double> kNoises[] = {{1.0, 1.0}, {0.2, 0.3}, {0.2, 0.02}, {1.0, 0.3}, {1.0, 0.02}};
  Eigen::ArrayXXd log_likelihood(offset_count, std::size(kNoises));
  for (std::size_t n = 0; n < std::size(kNoises); ++n) {
    const auto [time_s, white] = kNoises[n];
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(size, size);
    for (Eigen::Index k = 0; k < size; ++k) {
      for (Eigen::Index l = 0; l < k; ++l) {
        const double apart_s = means.time_s[static_cast<std::size_t>(k)] - means.time_s[static_cast<std::size_t>(l)];
        covariance(k, l) = covariance(l, k) = (1.0 - white) * std::exp(-apart_s / time_s);
      }
    }
    const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
    const auto root = factor.matrixL();
    const double log_determinant = 2.0 * Eigen::MatrixXd(root).diagonal().array().log().sum();
    const Eigen::VectorXd white_force = root.solve(force);
    const double round_off = 1.0e-20 * white_force.squaredNorm() + std::numeric_limits<double>::min();
    for (Eigen::Index j = 0; j < offset_count; ++j) {
      const Eigen::MatrixXd model = root.solve(models[static_cast<std::size_t>(j)]);
      const Eigen::VectorXd residual = white_force - model * model.colPivHouseholderQr().solve(white_force).eval();
      // The size of the noise integrated out; what is left of a perfect fit is round-off.
      log_likelihood(j, static_cast<Eigen::Index>(n)) =
          -0.5 * static_cast<double>(size - kParameters) * std::log(std::max(residual.squaredNorm(), round_off)) -
          0.5 * log_determinant;
    }
  }
  // Numbers near the largest that there are overflow above; such a window tells nothing.
  if (!log_likelihood.allFinite()) return Eigen::ArrayXd::Zero(offset_count);
  const Eigen::ArrayXd most = log_likelihood.rowwise().maxCoeff();
  return most + (log_likelihood.colwise() - most).exp().rowwise().sum().log();
}

}  // namespace

ClockOffset computeClockOffset(const std::vector<double>& time_s, const std::vector<double>& force_n,
                               const std::vector<double>& position_m, const std::vector<double>& speed_mps,
                               const std::vector<TimeSpan>& windows) {
  assert(time_s.size() > 1 && !windows.empty());
  constexpr int kStepsEachWay = 60;
  const double mean_interval_s = (time_s.back() - time_s.front()) / static_cast<double>(time_s.size() - 1);
  const Motion motion{time_s, position_m, speed_mps, std::max(0.05, mean_interval_s)};
  const Eigen::Index window_count = static_cast<Eigen::Index>(windows.size());
  std::vector<double> offsets_s;
  for (int k = -kStepsEachWay; k <= kStepsEachWay; ++k) offsets_s.push_back(kMaxClockOffsetS * k / kStepsEachWay);
  const Eigen::Map<const Eigen::ArrayXd> offset(offsets_s.data(), static_cast<Eigen::Index>(offsets_s.size()));
  Eigen::ArrayXXd log_likelihood(offset.size(), window_count);
  for (Eigen::Index k = 0; k < window_count; ++k) {
    log_likelihood.col(k) =
        offsetLogLikelihood(motion, forceMeans(time_s, force_n, windows[static_cast<std::size_t>(k)]), offsets_s);
  }
  const auto weightOf = [](const Eigen::ArrayXd& sum) { return (sum - sum.maxCoeff()).exp().eval(); };
  const Eigen::ArrayXd all = log_likelihood.rowwise().sum();
  const Eigen::ArrayXd weight = weightOf(all);
  ClockOffset clock;
  clock.offset_s = (weight * offset).sum() / weight.sum();
  double variance = (weight * (offset - clock.offset_s).square()).sum() / weight.sum();
  if (window_count > 1) {
    Eigen::ArrayXd without(window_count);
    for (Eigen::Index k = 0; k < window_count; ++k) {
      const Eigen::ArrayXd others = weightOf(all - log_likelihood.col(k));
      without[k] = (others * offset).sum() / others.sum();
    }
    const double count = static_cast<double>(window_count);
    variance = std::max(variance, (count - 1.0) / count * (without - without.mean()).square().sum());
  }
  clock.sigma_s = std::hypot(std::sqrt(variance), kModelSigmaS);
  return clock;
}

}  // namespace brash_ice_rig
