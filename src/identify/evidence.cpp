#include "brash_ice_rig/identify/evidence.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <nlopt.hpp>

#include "brash_ice_rig/math/angle.h"

namespace brash_ice_rig {
namespace {

constexpr double kMaxKappa = 4.0;

Eigen::LLT<Eigen::MatrixXd> factored(const Eigen::MatrixXd& covariance) {
  Eigen::LLT<Eigen::MatrixXd> llt(covariance);
  if (llt.info() != Eigen::Success) throw std::runtime_error("the covariance of the errors is not positive definite");
  return llt;
}

double logDeterminant(const Eigen::LLT<Eigen::MatrixXd>& llt) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < llt.rows(); ++i) sum += 2.0 * std::log(llt.matrixLLT()(i, i));
  return sum;
}

/// ln erfc(x), also where erfc is too small for a double. Abramowitz and Stegun 1964, eq. 7.1.23.
double logErfc(double x) {
  if (x < 20.0) return std::log(std::erfc(x));
  const double inverse = 0.5 / (x * x);
  return -x * x - std::log(x * std::sqrt(kPi)) + std::log1p(-inverse + 3.0 * inverse * inverse);
}

/// Everything that one value of kappa gives.
struct Solution {
  double log_evidence;
  Eigen::VectorXd x;
  Eigen::MatrixXd covariance;
};

Solution solve(const Eigen::VectorXd& y, const LinearModel& m, const FactoredErrors& errors) {
  const auto& llt = errors.factor;
  const Eigen::VectorXd r = llt.matrixL().solve(y - m.offset - m.columns * m.prior_mean);
  Solution s;
  const double n = static_cast<double>(y.size());
  s.log_evidence = -0.5 * (r.squaredNorm() + logDeterminant(llt) + n * std::log(2.0 * kPi));
  s.log_evidence += errors.log_prior;
  const Eigen::Index count = m.columns.cols();
  s.x = m.prior_mean;
  s.covariance = Eigen::MatrixXd::Zero(count, count);
  if (count == 0) return s;

  // In units of the priors' deviations: A = I + Gᵀ K⁻¹ G.
  const Eigen::MatrixXd g = llt.matrixL().solve(m.columns * m.prior_sigma.asDiagonal());
  const Eigen::MatrixXd a = Eigen::MatrixXd::Identity(count, count) + g.transpose() * g;
  const auto a_llt = factored(a);
  const Eigen::VectorXd b = g.transpose() * r;
  Eigen::VectorXd z = a_llt.solve(b);
  s.log_evidence += 0.5 * b.dot(z) - 0.5 * logDeterminant(a_llt);
  const Eigen::MatrixXd inverse = a_llt.solve(Eigen::MatrixXd::Identity(count, count));
  s.covariance = m.prior_sigma.asDiagonal() * inverse * m.prior_sigma.asDiagonal();

  // Positive ones: the share of the probability on their side, doubled because the prior has only that side.
  std::vector<bool> fixed(static_cast<std::size_t>(count), false);
  for (Eigen::Index k = 0; k < count; ++k) {
    if (!m.positive[static_cast<std::size_t>(k)]) continue;
    const double scaled = z[k] / std::sqrt(inverse(k, k));
    s.log_evidence += logErfc(-scaled / std::sqrt(2.0));
  }
  // The mode: negative ones are put to zero, one after the other, and the rest is solved again.
  for (Eigen::Index pass = 0; pass < count; ++pass) {
    Eigen::Index worst = -1;
    for (Eigen::Index k = 0; k < count; ++k) {
      if (m.positive[static_cast<std::size_t>(k)] && !fixed[static_cast<std::size_t>(k)] && z[k] < 0.0 &&
          (worst < 0 || z[k] < z[worst])) {
        worst = k;
      }
    }
    if (worst < 0) break;
    fixed[static_cast<std::size_t>(worst)] = true;
    Eigen::MatrixXd held = a;
    Eigen::VectorXd right = b;
    for (Eigen::Index k = 0; k < count; ++k) {
      if (!fixed[static_cast<std::size_t>(k)]) continue;
      held.row(k).setZero();
      held.col(k).setZero();
      held(k, k) = 1.0;
      right[k] = 0.0;
    }
    z = held.ldlt().solve(right);
  }
  s.x = m.prior_mean + m.prior_sigma.cwiseProduct(z);
  return s;
}

}  // namespace

FactoredErrors::FactoredErrors(const ErrorModel& errors, double kappa)
    : factor(factored(errors.noise + kappa * kappa * errors.discrepancy)) {
  const double log_kappa = std::log(kappa) / errors.log_kappa_sigma;
  log_prior = -0.5 * log_kappa * log_kappa;
}

double computeLogEvidence(const Eigen::VectorXd& y, const LinearModel& model, const FactoredErrors& errors) {
  return solve(y, model, errors).log_evidence;
}

LinearFit fitLinear(const Eigen::VectorXd& y, const LinearModel& m, const ErrorModel& errors) {
  assert(m.offset.size() == y.size() && m.columns.rows() == y.size());
  assert(m.prior_mean.size() == m.columns.cols() && m.prior_sigma.size() == m.columns.cols());
  assert(m.positive.size() == static_cast<std::size_t>(m.columns.cols()));
  nlopt::opt search(nlopt::LN_SBPLX, 1);
  const double bound = std::log(kMaxKappa);
  search.set_lower_bounds(-bound);
  search.set_upper_bounds(bound);
  search.set_initial_step(0.3);
  search.set_xtol_abs(1e-3);
  search.set_maxeval(60);
  struct Task {
    const Eigen::VectorXd& y;
    const LinearModel& model;
    const ErrorModel& errors;
  } task{y, m, errors};
  search.set_max_objective(
      [](unsigned, const double* x, double*, void* data) {
        const auto& t = *static_cast<const Task*>(data);
        return solve(t.y, t.model, FactoredErrors(t.errors, std::exp(x[0]))).log_evidence;
      },
      &task);
  std::vector<double> log_kappa{0.0};
  double best = 0.0;
  search.optimize(log_kappa, best);

  LinearFit fit;
  fit.kappa = std::exp(log_kappa[0]);
  const Solution s = solve(y, m, FactoredErrors(errors, fit.kappa));
  fit.log_evidence = s.log_evidence;
  fit.x = s.x;
  fit.covariance = s.covariance;
  fit.mean = m.offset + m.columns * s.x;
  fit.whitened = factored(errors.noise + errors.discrepancy).matrixL().solve(y - fit.mean);
  fit.chi2_per_datum = fit.whitened.squaredNorm() / static_cast<double>(y.size());
  return fit;
}

namespace {

/// A model without one of its unknowns, which is held.
struct HeldModel {
  LinearModel rest;
  Eigen::VectorXd column;
  double prior_mean, prior_sigma;
  bool positive;

  HeldModel(const LinearModel& m, Eigen::Index held)
      : column(m.columns.col(held)),
        prior_mean(m.prior_mean[held]),
        prior_sigma(m.prior_sigma[held]),
        positive(m.positive[static_cast<std::size_t>(held)]) {
    const Eigen::Index count = m.columns.cols() - 1;
    rest.columns.resize(m.columns.rows(), count);
    rest.prior_mean.resize(count);
    rest.prior_sigma.resize(count);
    for (Eigen::Index k = 0, to = 0; k <= count; ++k) {
      if (k == held) continue;
      rest.columns.col(to) = m.columns.col(k);
      rest.prior_mean[to] = m.prior_mean[k];
      rest.prior_sigma[to] = m.prior_sigma[k];
      rest.positive.push_back(m.positive[static_cast<std::size_t>(k)]);
      ++to;
    }
    rest.offset = m.offset;
  }

  double logPrior(double a) const {
    const double z = (a - prior_mean) / prior_sigma;
    return -0.5 * z * z - std::log(prior_sigma * std::sqrt(2.0 * kPi)) + (positive ? std::log(2.0) : 0.0);
  }
};

/// Weights of the trapezoidal rule.
std::vector<double> trapezoids(const std::vector<double>& at) {
  std::vector<double> weights(at.size(), 0.0);
  for (std::size_t i = 0; i + 1 < at.size(); ++i) {
    weights[i] += 0.5 * (at[i + 1] - at[i]);
    weights[i + 1] += 0.5 * (at[i + 1] - at[i]);
  }
  return weights;
}

}  // namespace

LinearFit fitWithForm(const Eigen::VectorXd& y, const LinearModel& m, const ErrorModel& errors, Eigen::Index column,
                      const Eigen::MatrixXd& form, UnknownDensity& density) {
  assert(column >= 0 && column < m.columns.cols());
  const HeldModel held(m, column);
  const auto errorsAt = [&](double a) {
    ErrorModel e = errors;
    e.noise += a * a * form;
    return e;
  };
  // ln of the density, with kappa at its mode: on the parabola through three values about a near guess.
  double log_kappa = std::log(fitLinear(y, m, errors).kappa);
  const auto logDensity = [&](double a) {
    constexpr double kStep = 0.2;
    const ErrorModel e = errorsAt(a);
    LinearModel model = held.rest;
    model.offset += a * held.column;
    const auto at = [&](double lk) { return solve(y, model, FactoredErrors(e, std::exp(lk))).log_evidence; };
    double best = at(log_kappa);
    for (int pass = 0; pass < 2; ++pass) {
      const double below = at(log_kappa - kStep), above = at(log_kappa + kStep);
      const double bend = below - 2.0 * best + above;
      const double move = bend < 0.0 ? 0.5 * kStep * (below - above) / bend : above > below ? kStep : -kStep;
      const double bound = std::log(kMaxKappa);
      const double moved = std::clamp(log_kappa + std::clamp(move, -3.0 * kStep, 3.0 * kStep), -bound, bound);
      const bool near = std::abs(moved - log_kappa) < kStep;
      const double there = at(moved);
      if (there > best) {
        best = there;
        log_kappa = moved;
      }
      if (near) break;
    }
    return best + held.logPrior(a);
  };

  // From coarse to fine where the density is: a cell is halved while it is within reach of the top and bends.
  constexpr double kReach = 4.0, kDeep = 8.0, kStepNats = 0.5, kStepAtTopNats = 0.05;
  constexpr std::size_t kCells = 12, kMost = 80;
  const double low = held.positive ? 0.0 : held.prior_mean - kReach * held.prior_sigma;
  const double high = held.prior_mean + kReach * held.prior_sigma;
  density = {};
  for (std::size_t i = 0; i <= kCells; ++i) {
    density.value.push_back(low + (high - low) * static_cast<double>(i) / static_cast<double>(kCells));
    density.log_density.push_back(logDensity(density.value.back()));
  }
  for (bool finer = true; finer && density.value.size() < kMost;) {
    finer = false;
    const double top = *std::max_element(density.log_density.begin(), density.log_density.end());
    UnknownDensity halved;
    for (std::size_t i = 0; i < density.value.size(); ++i) {
      halved.value.push_back(density.value[i]);
      halved.log_density.push_back(density.log_density[i]);
      if (i + 1 == density.value.size()) break;
      const double here = density.log_density[i], next = density.log_density[i + 1];
      const bool close = std::max(here, next) > top - kDeep;
      const double step = here == top || next == top ? kStepAtTopNats : kStepNats;
      const bool wide = density.value[i + 1] - density.value[i] > 1e-4 * (high - low);
      if (wide && close && std::abs(next - here) > step) {
        const double middle = 0.5 * (density.value[i] + density.value[i + 1]);
        halved.value.push_back(middle);
        halved.log_density.push_back(logDensity(middle));
        finer = true;
      }
    }
    density = halved;
  }

  const std::vector<double> weights = trapezoids(density.value);
  const auto top = static_cast<std::size_t>(std::max_element(density.log_density.begin(), density.log_density.end()) -
                                            density.log_density.begin());
  double sum = 0.0, first = 0.0, second = 0.0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double p = weights[i] * std::exp(density.log_density[i] - density.log_density[top]);
    const double off = density.value[i] - density.value[top];
    sum += p;
    first += p * off;
    second += p * off * off;
  }
  const double a = density.value[top];
  LinearModel model = held.rest;
  model.offset += a * held.column;
  const LinearFit rest = fitLinear(y, model, errorsAt(a));
  LinearFit fit = rest;
  fit.log_evidence = density.log_density[top] + std::log(sum);
  const Eigen::Index count = m.columns.cols();
  fit.x.resize(count);
  fit.covariance = Eigen::MatrixXd::Zero(count, count);
  for (Eigen::Index k = 0, from = 0; k < count; ++k) {
    if (k == column) continue;
    fit.x[k] = rest.x[from];
    for (Eigen::Index l = 0, other = 0; l < count; ++l) {
      if (l != column) fit.covariance(k, l) = rest.covariance(from, other++);
    }
    ++from;
  }
  fit.x[column] = a;
  fit.covariance(column, column) = second / sum - first * first / (sum * sum);
  return fit;
}

double computeQuantile(const std::vector<UnknownDensity>& densities, double share) {
  assert(!densities.empty());
  double top = -std::numeric_limits<double>::infinity();
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const UnknownDensity& d : densities) {
    top = std::max(top, *std::max_element(d.log_density.begin(), d.log_density.end()));
    low = std::min(low, d.value.front());
    high = std::max(high, d.value.back());
  }
  // Probability below x, not normalised: trapezoids of each density, the last one cut at x.
  const auto below = [&](double x) {
    double sum = 0.0;
    for (const UnknownDensity& d : densities) {
      for (std::size_t i = 0; i + 1 < d.value.size() && d.value[i] < x; ++i) {
        const double part = std::min((x - d.value[i]) / (d.value[i + 1] - d.value[i]), 1.0);
        const double here = std::exp(d.log_density[i] - top), next = std::exp(d.log_density[i + 1] - top);
        sum += part * (d.value[i + 1] - d.value[i]) * (here + 0.5 * part * (next - here));
      }
    }
    return sum;
  };
  const double wanted = share * below(high);
  for (int halving = 0; halving < 60; ++halving) {
    const double middle = 0.5 * (low + high);
    (below(middle) < wanted ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double computeLogDensity(const Eigen::VectorXd& y, const std::vector<LinearModel>& models,
                         const std::vector<double>& log_weight, const ErrorModel& errors) {
  assert(!models.empty() && models.size() == log_weight.size());
  constexpr int kSteps = 9;  // of kappa to either side
  double best = -std::numeric_limits<double>::infinity();
  for (int step = -kSteps; step <= kSteps; ++step) {
    const FactoredErrors factored(errors, std::exp(std::log(kMaxKappa) * step / kSteps));
    std::vector<double> weighed;
    for (std::size_t i = 0; i < models.size(); ++i) {
      weighed.push_back(computeLogEvidence(y, models[i], factored) + log_weight[i]);
    }
    best = std::max(best, logMeanExp(weighed));
  }
  return best - logMeanExp(log_weight);
}

Detectability::Detectability(const LinearModel& baseline, const ErrorModel& errors, double kappa) {
  const Eigen::MatrixXd scaled = baseline.columns * baseline.prior_sigma.asDiagonal();
  const auto llt = factored(errors.noise + kappa * kappa * errors.discrepancy + scaled * scaled.transpose());
  inverse_ = llt.solve(Eigen::MatrixXd::Identity(llt.rows(), llt.rows()));
}

double Detectability::of(const Eigen::VectorXd& change) const {
  return std::sqrt(std::max(0.0, change.dot(inverse_ * change)));
}

double Detectability::ofRepeats(const std::vector<Eigen::VectorXd>& repeats) const {
  assert(!repeats.empty());
  if (repeats.size() == 1) return of(repeats.front());
  double sum = 0.0, count = 0.0;
  for (std::size_t i = 0; i < repeats.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      sum += repeats[i].dot(inverse_ * repeats[k]);
      count += 1.0;
    }
  }
  return std::sqrt(std::max(0.0, sum / count));
}

double Detectability::correlation(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const {
  const double norms = of(a) * of(b);
  return norms > 0.0 ? a.dot(inverse_ * b) / norms : 0.0;
}

std::vector<double> computeAutocorrelation(const Eigen::VectorXd& values, int n) {
  const Eigen::VectorXd centred = values.array() - values.mean();
  const double variance = centred.squaredNorm();
  std::vector<double> r;
  for (int lag = 0; lag <= n; ++lag) {
    const Eigen::Index rest = centred.size() - lag;
    r.push_back(rest > 0 && variance > 0.0 ? centred.head(rest).dot(centred.tail(rest)) / variance : 0.0);
  }
  return r;
}

double computeChiSquareTail(double value, double degrees) {
  // Regularised upper incomplete gamma function Q(a, x): series below a + 1, continued fraction above (Press et al.,
  // Numerical Recipes, section 6.2).
  const double a = 0.5 * degrees, x = 0.5 * value;
  if (!(x > 0.0)) return 1.0;
  const double front = std::exp(-x + a * std::log(x) - std::lgamma(a));
  if (x < a + 1.0) {
    double term = 1.0 / a, sum = term;
    for (int k = 1; k < 1000 && term > sum * 1e-15; ++k) {
      term *= x / (a + k);
      sum += term;
    }
    return 1.0 - front * sum;
  }
  constexpr double kTiny = 1e-300;
  double b = x + 1.0 - a, c = 1.0 / kTiny, d = 1.0 / b, h = d;
  for (int k = 1; k < 1000; ++k) {
    const double an = -k * (k - a);
    b += 2.0;
    d = an * d + b;
    if (std::abs(d) < kTiny) d = kTiny;
    c = b + an / c;
    if (std::abs(c) < kTiny) c = kTiny;
    d = 1.0 / d;
    const double factor = d * c;
    h *= factor;
    if (std::abs(factor - 1.0) < 1e-15) break;
  }
  return front * h;
}

double computeLjungBox(const Eigen::VectorXd& values, int lags) {
  const double n = static_cast<double>(values.size());
  if (n < 3.0 * lags) return 1.0;
  const std::vector<double> r = computeAutocorrelation(values, lags);
  double q = 0.0;
  for (int lag = 1; lag <= lags; ++lag)
    q += r[static_cast<std::size_t>(lag)] * r[static_cast<std::size_t>(lag)] / (n - lag);
  return computeChiSquareTail(n * (n + 2.0) * q, lags);
}

double logMeanExp(const std::vector<double>& values) {
  assert(!values.empty());
  const double largest = *std::max_element(values.begin(), values.end());
  if (!std::isfinite(largest)) return largest;
  double sum = 0.0;
  for (const double value : values) sum += std::exp(value - largest);
  return largest + std::log(sum / static_cast<double>(values.size()));
}

}  // namespace brash_ice_rig
