#include "brash_ice_rig/node/live_residual.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/complement.hpp>
#include <boost/math/distributions/fisher_f.hpp>

namespace brash_ice_rig {
namespace {

/// Bins that wait for their counterpart are given up after this, s.
constexpr double kLongestWaitS = 60.0;
/// Enough for a straight line and a spread about it.
constexpr std::size_t kLeastLearnedBins = 8;

/// A straight line through equidistant values, taken off.
std::vector<double> withoutLine(std::vector<double> y) {
  const auto n = static_cast<double>(y.size());
  double mean = 0.0, slope = 0.0, square = 0.0;
  for (const double value : y) mean += value / n;
  for (std::size_t i = 0; i < y.size(); ++i) {
    const double x = static_cast<double>(i) - 0.5 * (n - 1.0);
    slope += x * y[i];
    square += x * x;
  }
  for (std::size_t i = 0; i < y.size(); ++i) {
    y[i] -= mean + slope / square * (static_cast<double>(i) - 0.5 * (n - 1.0));
  }
  return y;
}

struct Likelihood {
  double log = 0.0;       ///< without constants
  double variance = 0.0;  ///< total, that maximises it
};

/// Of values whose covariance is variance * ((1 - share) I + share exp(-|dt| / time_s)), profiled over the variance.
Likelihood computeLikelihood(const std::vector<double>& y, double bin_s, double share, double time_s) {
  const double decay = std::exp(-bin_s / time_s);
  double state = 0.0, covariance = share, square = 0.0, log_sum = 0.0;
  for (std::size_t i = 0; i < y.size(); ++i) {
    if (i > 0) {
      state *= decay;
      covariance = covariance * decay * decay + share * (1.0 - decay * decay);
    }
    const double innovation_variance = covariance + 1.0 - share;
    const double innovation = y[i] - state;
    square += innovation * innovation / innovation_variance;
    log_sum += std::log(innovation_variance);
    const double gain = covariance / innovation_variance;
    state += gain * innovation;
    covariance -= gain * covariance;
  }
  const auto n = static_cast<double>(y.size());
  return {-0.5 * (log_sum + n * std::log(square / n)), square / n};
}

bool below(double p, double threshold) {
  return p < threshold;  // false for NaN
}

}  // namespace

ResidualNoise estimateNoise(const std::vector<double>& force_n, double bin_s, double floor_n) {
  assert(force_n.size() >= kLeastLearnedBins);
  const std::vector<double> y = withoutLine(force_n);
  const auto n = static_cast<double>(y.size());
  constexpr double kLineParameters = 2.0, kNoiseParameters = 3.0;
  ResidualNoise noise;
  noise.degrees_of_freedom = (n - kLineParameters) / kNoiseParameters;
  noise.white_n = floor_n;
  const bool silent = std::all_of(y.begin(), y.end(), [&](double value) { return std::abs(value) < 1.0e-3 * floor_n; });
  if (silent) return noise;

  double best = -std::numeric_limits<double>::infinity();
  for (const double time_s : {0.5, 1.0, 2.0, 4.0, 8.0}) {
    for (const double share : {0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95}) {
      const Likelihood likelihood = computeLikelihood(y, bin_s, share, time_s);
      if (likelihood.log <= best) continue;
      best = likelihood.log;
      const double variance = likelihood.variance * n / (n - kLineParameters);
      noise.white_n = std::max(floor_n, std::sqrt((1.0 - share) * variance));
      noise.slow_n = std::sqrt(share * variance);
      noise.slow_time_s = time_s;
    }
  }
  return noise;
}

ResidualTest testWhitened(const std::vector<double>& whitened, std::size_t begin, double degrees_of_freedom) {
  namespace math = boost::math;
  assert(begin < whitened.size());
  ResidualTest test;
  test.bins = whitened.size() - begin;
  const auto n = static_cast<double>(test.bins);
  double square = 0.0, mean = 0.0;
  for (std::size_t i = begin; i < whitened.size(); ++i) {
    square += whitened[i] * whitened[i];
    mean += whitened[i] / n;
  }
  test.chi2_ratio = square / n;
  test.chi2_p = std::isinf(degrees_of_freedom)
                    ? math::cdf(math::complement(math::chi_squared(n), square))
                    : math::cdf(math::complement(math::fisher_f(n, degrees_of_freedom), test.chi2_ratio));
  if (test.bins < kLjungBoxLeastBins) return test;

  // Q = n (n + 2) sum_k rho_k² / (n - k) (Ljung and Box 1978).
  const auto correlation = [&](std::size_t lag) {
    double sum = 0.0;
    for (std::size_t i = begin + lag; i < whitened.size(); ++i)
      sum += (whitened[i] - mean) * (whitened[i - lag] - mean);
    return sum;
  };
  const double variance = correlation(0);
  if (variance <= 0.0) return test;  // all the same: nothing to correlate
  double q = 0.0;
  for (std::size_t lag = 1; lag <= kLjungBoxLags; ++lag) {
    const double rho = correlation(lag) / variance;
    q += rho * rho / (n - static_cast<double>(lag));
  }
  q *= n * (n + 2.0) / (1.0 + n / degrees_of_freedom);
  test.ljung_box_p = math::cdf(math::complement(math::chi_squared(static_cast<double>(kLjungBoxLags)), q));
  return test;
}

LiveResidual::LiveResidual(const LiveResidualSettings& settings) : settings_(settings) {}

void LiveResidual::addMeasured(double stamp_s, double force_n) {
  add(measured_, stamp_s, force_n);
}

void LiveResidual::addSimulated(double stamp_s, double force_n) {
  add(simulated_, stamp_s, force_n);
}

void LiveResidual::add(Stream& stream, double stamp_s, double force_n) {
  if (!std::isfinite(stamp_s) || !std::isfinite(force_n)) return;
  // A hair later, so that a sample on the edge of a bin, rounded to ns, always falls on the same side.
  constexpr double kStampRoundingS = 1.0e-6;
  const auto bin = static_cast<std::int64_t>(std::floor((stamp_s + kStampRoundingS) * settings_.bin_rate_hz));
  if (bin < next_bin_) {
    ++late_samples_;
    return;
  }
  if (!stream.first_bin) stream.first_bin = bin;
  stream.newest_s = std::max(stream.newest_s.value_or(stamp_s), stamp_s);
  if (bin == *stream.first_bin) return;
  Mean& mean = stream.bins[bin];
  mean.sum += force_n;
  mean.stamp_sum += stamp_s;
  ++mean.count;
}

std::vector<ResidualReport> LiveResidual::take() {
  std::vector<ResidualReport> reports;
  if (!measured_.newest_s || !simulated_.newest_s) return reports;
  const double both_s = std::min(*measured_.newest_s, *simulated_.newest_s) - settings_.lateness_s;
  const double either_s = std::max(*measured_.newest_s, *simulated_.newest_s) - kLongestWaitS;
  const auto closed =
      static_cast<std::int64_t>(std::floor(std::max(both_s, either_s) * settings_.bin_rate_hz));  // up to here
  while (!measured_.bins.empty() || !simulated_.bins.empty()) {
    std::int64_t bin = std::numeric_limits<std::int64_t>::max();
    for (const Stream* stream : {&measured_, &simulated_}) {
      if (!stream->bins.empty()) bin = std::min(bin, stream->bins.begin()->first);
    }
    if (bin >= closed) break;
    if (std::optional<ResidualReport> report = close(bin)) reports.push_back(*report);
    measured_.bins.erase(bin);
    simulated_.bins.erase(bin);
    next_bin_ = bin + 1;
  }
  return reports;
}

std::optional<ResidualReport> LiveResidual::close(std::int64_t bin) {
  const auto measured = measured_.bins.find(bin), simulated = simulated_.bins.find(bin);
  if (measured == measured_.bins.end() || simulated == simulated_.bins.end()) return std::nullopt;
  const auto meanOf = [](double sum, const Mean& mean) { return sum / static_cast<double>(mean.count); };
  // Where one of the two covers a part of the bin only, the force has moved on in between.
  const double apart_s =
      meanOf(measured->second.stamp_sum, measured->second) - meanOf(simulated->second.stamp_sum, simulated->second);
  if (std::abs(apart_s) > 0.25 / settings_.bin_rate_hz) return std::nullopt;
  ResidualReport report;
  report.time_s = (static_cast<double>(bin) + 0.5) / settings_.bin_rate_hz;
  report.measured_n = meanOf(measured->second.sum, measured->second);
  report.simulated_n = meanOf(simulated->second.sum, simulated->second);
  report.residual_n = report.measured_n - report.simulated_n;
  if (settings_.noise) {
    whiten(report);
  } else {
    learned_.push_back(report.residual_n);
    if (static_cast<double>(learned_.size()) >= settings_.learn_s * settings_.bin_rate_hz) stopLearning();
  }
  return report;
}

void LiveResidual::stopLearning() {
  if (settings_.noise || learned_.size() < kLeastLearnedBins) return;
  settings_.noise = estimateNoise(learned_, 1.0 / settings_.bin_rate_hz, settings_.noise_floor_n);
}

void LiveResidual::whiten(ResidualReport& report) {
  const ResidualNoise& noise = *settings_.noise;
  const double variance[2] = {noise.slow_n * noise.slow_n, 1.0};
  const double time_s[2] = {noise.slow_time_s, settings_.discrepancy_time_s};
  for (int i = 0; i < 2; ++i) {
    const double decay = filtered_s_ ? std::exp(-(report.time_s - *filtered_s_) / time_s[i]) : 0.0;
    state_[i] *= decay;
    for (int j = 0; j < 2; ++j) {
      covariance_[i][j] *= decay;
      covariance_[j][i] *= decay;
    }
    covariance_[i][i] += variance[i] * (1.0 - decay * decay);
  }
  filtered_s_ = report.time_s;

  const double weight[2] = {1.0, settings_.discrepancy_ratio * std::abs(report.simulated_n)};
  const double white = std::max(noise.white_n, settings_.noise_floor_n);
  double gain[2];
  double innovation_variance = white * white, expected = 0.0;
  for (int i = 0; i < 2; ++i) {
    gain[i] = covariance_[i][0] * weight[0] + covariance_[i][1] * weight[1];
    innovation_variance += weight[i] * gain[i];
    expected += weight[i] * state_[i];
  }
  const double noise_variance = white * white + covariance_[0][0];
  const double innovation = report.residual_n - expected;
  for (int i = 0; i < 2; ++i) {
    state_[i] += gain[i] / innovation_variance * innovation;
    for (int j = 0; j < 2; ++j) covariance_[i][j] -= gain[i] * gain[j] / innovation_variance;
  }

  whitened_.push_back(innovation / std::sqrt(innovation_variance));
  noise_shares_.push_back(std::min(1.0, noise_variance / innovation_variance));
  square_sum_ += report.residual_n * report.residual_n;
  window_times_s_.push_back(report.time_s);
  while (window_times_s_.front() <= report.time_s - settings_.window_s) window_times_s_.pop_front();

  report.learning = false;
  report.expected_sigma_n = std::sqrt(white * white + variance[0] + weight[1] * weight[1]);
  report.whitened_ratio = whitened_.back();
  report.rms_n = std::sqrt(square_sum_ / static_cast<double>(whitened_.size()));
  const auto test = [&](std::size_t begin) {
    const auto bins = static_cast<double>(noise_shares_.size() - begin);
    const double share =
        std::accumulate(noise_shares_.begin() + static_cast<std::ptrdiff_t>(begin), noise_shares_.end(), 0.0) / bins;
    // Welch and Satterthwaite: only the noise's part of the variance is uncertain.
    return testWhitened(whitened_, begin, noise.degrees_of_freedom / (share * share));
  };
  report.window = test(whitened_.size() - window_times_s_.size());
  report.test = test(0);
  for (const ResidualTest* each : {&report.window, &report.test}) {
    // Smaller than allowed, they are correlated because the allowance was not used: that is no difference.
    const bool correlated = each->chi2_ratio >= 1.0 && below(each->ljung_box_p, settings_.significance_p);
    report.significant = report.significant || correlated || below(each->chi2_p, settings_.significance_p);
  }
  if (report.significant && std::isnan(significant_since_s_)) significant_since_s_ = report.time_s;
  report.significant_since_s = significant_since_s_;
}

}  // namespace brash_ice_rig
