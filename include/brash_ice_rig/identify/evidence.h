#pragma once

#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace brash_ice_rig {

/// Data that are a mean plus columns times unknowns, plus errors of a known covariance up to a scale:
///   y = offset + columns x + errors,  x ~ N(prior_mean, prior_sigma²),  errors ~ N(0, noise + kappa² discrepancy)
struct LinearModel {
  Eigen::VectorXd offset;
  Eigen::MatrixXd columns;  ///< as many rows as data; may have no columns
  Eigen::VectorXd prior_mean, prior_sigma;
  std::vector<bool> positive;  ///< per column: the prior's negative half is folded away
};

/// Errors beside a linear model.
struct ErrorModel {
  Eigen::MatrixXd noise, discrepancy;
  double log_kappa_sigma = 0.3;  ///< standard deviation of ln kappa, about 0
};

/// The errors at one kappa, factored: for many models that share them.
struct FactoredErrors {
  /// @throws std::runtime_error if the covariance is not positive definite
  FactoredErrors(const ErrorModel& errors, double kappa);

  Eigen::LLT<Eigen::MatrixXd> factor;  ///< of the covariance
  double log_prior = 0.0;              ///< of kappa
};

struct LinearFit {
  double log_evidence = 0.0;  ///< with the prior of kappa at its mode
  double kappa = 1.0;
  Eigen::VectorXd x;            ///< most probable unknowns; positive ones are not negative
  Eigen::MatrixXd covariance;   ///< of x, Gaussian
  Eigen::VectorXd mean;         ///< offset + columns x
  double chi2_per_datum = 0.0;  ///< (y − mean)ᵀ K⁻¹ (y − mean) / N, K of kappa = 1
  Eigen::VectorXd whitened;     ///< L⁻¹ (y − mean), K = L Lᵀ of kappa = 1, in the order of the data
};

/// Fits by Bayes' rule. The evidence is that of the Gaussian model, with kappa at its most probable value within
/// [1/4, 4]; for each positive column, times twice the probability that it is positive.
/// @param y  data  @throws std::runtime_error if the covariance is not positive definite
LinearFit fitLinear(const Eigen::VectorXd& y, const LinearModel& model, const ErrorModel& errors);

/// Probability density of one unknown, all others left open; not normalised: its integral is the evidence.
struct UnknownDensity {
  std::vector<double> value, log_density;  ///< as many, the values increasing
};

/// As fitLinear(), where what one unknown does to the data may be off in its form: at the value a of this unknown the
/// errors grow by a² form. The density of a is then no Gaussian; it is integrated numerically.
/// @param column   of the unknown
/// @param form     covariance of what its column may be off, per square of its unit
/// @param density  out: of the unknown
/// @return x at the unknown's most probable value; its variance is that of the density, other unknowns' at that value
LinearFit fitWithForm(const Eigen::VectorXd& y, const LinearModel& model, const ErrorModel& errors, Eigen::Index column,
                      const Eigen::MatrixXd& form, UnknownDensity& density);

/// Value below which this share of the probability lies. @param densities  weighed by their evidence; at least one
double computeQuantile(const std::vector<UnknownDensity>& densities, double share);

/// ln of the evidence of a model at a given kappa.
double computeLogEvidence(const Eigen::VectorXd& y, const LinearModel& model, const FactoredErrors& errors);

/// ln of the probability density of data of which one of these models is true, with kappa at its most probable value
/// within [1/4, 4].
/// @param models      at least one, as long as y
/// @param log_weight  ln of how probable each is against the others
/// @throws std::runtime_error if the covariance is not positive definite
double computeLogDensity(const Eigen::VectorXd& y, const std::vector<LinearModel>& models,
                         const std::vector<double>& log_weight, const ErrorModel& errors);

/// What a change of the data does after everything else has been refitted: norms and products in the metric that
/// fitLinear() uses, with the columns of the baseline projected out as far as their priors let them.
class Detectability {
 public:
  Detectability(const LinearModel& baseline, const ErrorModel& errors, double kappa);

  /// Detectability d′ of a change: its norm.
  double of(const Eigen::VectorXd& change) const;
  /// Of a change that was seen several times, each time with a scatter of its own: from the products of different
  /// ones, in which the scatter cancels in the mean, where the norm of their mean would still count some of it (a
  /// U-statistic, Hoeffding 1948, Annals of Mathematical Statistics 19). 0 where nothing but scatter is seen.
  /// @param repeats  at least one; one alone tells no scatter and counts by its norm
  double ofRepeats(const std::vector<Eigen::VectorXd>& repeats) const;
  /// Cosine between two changes; 0 if one of them cannot be seen.
  double correlation(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const;

 private:
  Eigen::MatrixXd inverse_;
};

/// Lags of the portmanteau test of what is left.
constexpr int kPortmanteauLags = 20;

/// Ljung and Box (1978): p-value that the first `lags` autocorrelations are those of white noise. 1 where there are too
/// few values.
double computeLjungBox(const Eigen::VectorXd& values, int lags);

/// Autocorrelation at lags 0, 1, ..., n.
std::vector<double> computeAutocorrelation(const Eigen::VectorXd& values, int n);

/// Upper tail of the chi-square distribution. @param degrees  > 0
double computeChiSquareTail(double value, double degrees);

/// ln of the mean of exp(values). @param values  at least one
double logMeanExp(const std::vector<double>& values);

}  // namespace brash_ice_rig
