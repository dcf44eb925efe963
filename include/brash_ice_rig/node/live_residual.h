#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <optional>
#include <vector>

namespace brash_ice_rig {

/// Noise of the mean over a bin: white, plus exponentially correlated in time, slow_n² exp(-|dt| / slow_time_s).
struct ResidualNoise {
  double white_n = 0.0;      ///< standard deviation, >= 0
  double slow_n = 0.0;       ///< standard deviation, >= 0
  double slow_time_s = 1.0;  ///< > 0
  /// How well it is known: as a variance estimated from so many independent values; infinite: exactly.
  double degrees_of_freedom = std::numeric_limits<double>::infinity();
};

/// Maximum-likelihood noise of a stretch at rest, about its straight line. The share of the slow part and its time are
/// taken from a grid (tenths; 0.5 to 8 s), the size follows from them. As all three come from the same values, it
/// counts as known from a third of them.
/// @param force_n  one value per bin, at least 8
/// @param floor_n  the white part is at least this: a load cell has a resolution
ResidualNoise estimateNoise(const std::vector<double>& force_n, double bin_s, double floor_n);

/// What LiveResidual takes for granted.
struct LiveResidualSettings {
  double bin_rate_hz = 4.0;
  double window_s = 20.0;
  double learn_s = 20.0;            ///< at rest, from the first pair of bins on; not used where noise is given
  double lateness_s = 0.5;          ///< a bin stays open for so long after newer messages
  double discrepancy_ratio = 0.05;  ///< standard deviation of the model's own error over the simulated force
  double discrepancy_time_s = 5.0;  ///< time over which that error stays alike
  double noise_floor_n = 1.0;
  double significance_p = 1.0e-4;
  std::optional<ResidualNoise> noise;  ///< empty: estimated
};

/// Chi-square and portmanteau tests of a stretch of whitened residuals.
struct ResidualTest {
  std::size_t bins = 0;
  double chi2_ratio = std::numeric_limits<double>::quiet_NaN();   ///< mean square
  double chi2_p = std::numeric_limits<double>::quiet_NaN();       ///< P(so much or more)
  double ljung_box_p = std::numeric_limits<double>::quiet_NaN();  ///< NaN below kLeastBins
};

/// Bins from which on the Ljung-Box test is made, and its number of lags.
constexpr std::size_t kLjungBoxLeastBins = 40, kLjungBoxLags = 10;

/// @param begin  the first of `whitened` that counts; at least one follows
/// @param degrees_of_freedom  of the variance nu that they were divided by: with finite ones, the mean square is
/// compared
///   with Fisher's F instead of chi-square, and the variance of each correlation is 1/n + 1/nu instead of 1/n
ResidualTest testWhitened(const std::vector<double>& whitened, std::size_t begin, double degrees_of_freedom);

/// One bin.
struct ResidualReport {
  double time_s = 0.0;  ///< middle of the bin
  double measured_n = 0.0, simulated_n = 0.0, residual_n = 0.0;
  // NaN while the noise is still being learned:
  double expected_sigma_n = std::numeric_limits<double>::quiet_NaN();
  double whitened_ratio = std::numeric_limits<double>::quiet_NaN();
  double rms_n = std::numeric_limits<double>::quiet_NaN();
  ResidualTest window, test;
  bool learning = true;
  bool significant = false;
  double significant_since_s = std::numeric_limits<double>::quiet_NaN();  ///< first bin that was
};

/// Compares two streams of force, measured and simulated, as they come.
///
/// Both are averaged over bins, which are paired by their stamps. Measured minus simulated is taken for white and slow
/// noise of the sensor plus an error of the model proportional to the simulated force and correlated in time. This is a
/// linear process in state space, so that a Kalman filter whitens it exactly, one bin at a time and across gaps: the
/// sum of the squared whitened residuals is r' K^-1 r with K the covariance of all bins.
class LiveResidual {
 public:
  explicit LiveResidual(const LiveResidualSettings& settings);

  /// Samples may be out of order within lateness_s. Values that are not finite are left out.
  /// @param stamp_s  one clock for both, >= 0
  void addMeasured(double stamp_s, double force_n);
  void addSimulated(double stamp_s, double force_n);

  /// Reports on the bins that have been completed since the last call, in order.
  std::vector<ResidualReport> take();

  /// The rest is over: takes what has been learned, if it is enough.
  void stopLearning();

  std::uint64_t lateSamples() const { return late_samples_; }
  std::size_t learnedBins() const { return learned_.size(); }
  /// What is known of the noise; empty while it is being learned.
  const std::optional<ResidualNoise>& noise() const { return settings_.noise; }
  /// Stamp of the newest sample of either; empty: none yet.
  std::optional<double> newestMeasured() const { return measured_.newest_s; }
  std::optional<double> newestSimulated() const { return simulated_.newest_s; }

 private:
  struct Mean {
    double sum = 0.0, stamp_sum = 0.0;
    std::size_t count = 0;
  };
  struct Stream {
    std::map<std::int64_t, Mean> bins;
    std::optional<double> newest_s;
    std::optional<std::int64_t> first_bin;  ///< joined in the middle, as a rule: not used
  };

  void add(Stream& stream, double stamp_s, double force_n);
  std::optional<ResidualReport> close(std::int64_t bin);
  void whiten(ResidualReport& report);

  LiveResidualSettings settings_;
  Stream measured_, simulated_;
  std::int64_t next_bin_ = std::numeric_limits<std::int64_t>::min();  ///< the first that is still open
  std::uint64_t late_samples_ = 0;

  std::vector<double> learned_;  ///< residuals at rest
  // State of the filter: slow noise, N, and the model's error in units of its standard deviation.
  double state_[2] = {0.0, 0.0};
  double covariance_[2][2] = {{0.0, 0.0}, {0.0, 0.0}};
  std::optional<double> filtered_s_;  ///< time of the state
  std::vector<double> whitened_;
  std::vector<double> noise_shares_;  ///< of their variance, the part that is noise
  std::deque<double> window_times_s_;
  double square_sum_ = 0.0;
  double significant_since_s_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace brash_ice_rig
