#include "brash_ice_rig/identify/chain.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace brash_ice_rig {
namespace {

/// Mean of some simulations in the bins of a site.
Eigen::VectorXd meanOf(const Site& site, const std::vector<SimulatedForce>& forces, double delay_s) {
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(site.rows());
  for (const SimulatedForce& force : forces) mean += site.bins(force, delay_s) / static_cast<double>(forces.size());
  return mean;
}

/// What a model says of a record, with every delay that a spot may have: within 1.5 s, with a standard deviation of
/// 0.5 s.
struct Prediction {
  std::vector<SimulatedForce> forces;
  std::vector<Eigen::VectorXd> curves;  ///< of the mean, one per delay
  std::vector<double> delays_s, log_weight;
  std::size_t best = 0;  ///< the delay that fits the record best

  Prediction(const Site& site, std::vector<SimulatedForce> simulated) : forces(std::move(simulated)) {
    constexpr double kSigmaS = 0.5, kMostS = 1.5;
    constexpr int kSteps = 30;
    const Eigen::VectorXd& record = site.observation().force_n;
    const double scale = 0.05 * record.cwiseAbs().maxCoeff();
    double least_cost = std::numeric_limits<double>::infinity();
    for (int step = -kSteps; step <= kSteps; ++step) {
      delays_s.push_back(kMostS * step / kSteps);
      log_weight.push_back(-0.5 * delays_s.back() * delays_s.back() / (kSigmaS * kSigmaS));
      curves.push_back(meanOf(site, forces, delays_s.back()));
      const double cost = (record - curves.back()).squaredNorm() / (scale * scale) * 0.1 - 2.0 * log_weight.back();
      if (cost < least_cost) {
        least_cost = cost;
        best = curves.size() - 1;
      }
    }
  }

  const Eigen::VectorXd& curve() const { return curves[best]; }
};

double meanSquare(const Eigen::VectorXd& error) {
  return error.squaredNorm() / static_cast<double>(error.size());
}

}  // namespace

/// Predicts a record that was not fitted. Only its own delay is fitted, for every model alike: when the rim meets the
/// ice is a matter of the spot.
void Chain::evaluateHoldout(const Model& baseline, const std::vector<Model>& models, Identification& result) {
  Site site = makeSite(*input_.holdout);
  const Observation& o = site.observation();
  Model given;
  given.x = Eigen::VectorXd::Zero(unknowns());
  given.simulated = true;
  const auto forcesOf = [&](const Model& model, bool request_only) {
    std::vector<SimulatedForce> forces;
    for (int seed = 1; seed <= kPairs; ++seed) {
      const Scenario s = scenarioAt(site, model.x, model.variants, seed);
      const std::string key = runs_.request(s);
      if (request_only || runs_.failed(key)) continue;
      forces.push_back(&model == &given ? runs_.force(key) : asRead(corrected(key), s, model.x, model.variants));
    }
    return forces;
  };
  std::vector<const Model*> all{&given, &baseline};
  // What the evidence speaks against needs no prediction.
  for (std::size_t k = 0; k < models.size(); ++k) {
    if (models[k].simulated && result.ranking[k].log_bayes_factor > 0.0) all.push_back(&models[k]);
  }
  for (const Model* model : all) forcesOf(*model, true);
  runs_.makeMissing("held-out record");
  std::map<const Model*, Prediction> predictions;
  for (const Model* model : all) {
    const std::vector<SimulatedForce> forces = forcesOf(*model, false);
    if (!forces.empty()) predictions.emplace(model, Prediction(site, forces));
  }
  if (predictions.count(&given) == 0 || predictions.count(&baseline) == 0) return;
  const Prediction& without = predictions.at(&baseline);

  site.mean_n = predictions.at(&given).curve();
  site.chaos_n = Eigen::VectorXd::Zero(site.rows());
  site.known_share = Eigen::VectorXd::Zero(site.rows());
  ErrorModel errors;
  errors.noise = computeNoiseCovariance(o.noise, o.time_s);
  errors.discrepancy = Eigen::MatrixXd::Zero(site.rows(), site.rows());
  if (o.ice_contact) {
    site.known_share = computeKnownShare(discrepancy_, o.time_s, o.way_m);
    errors.discrepancy = discrepancyOf(site, without.curve());
  }
  const Eigen::MatrixXd covariance = errors.noise + errors.discrepancy;

  std::vector<Site> lateral = lateralSites(site);
  for (std::size_t i = 0; i < lateral.size(); ++i) {
    // How arrangements of the blocks differ sideways is known from the first record.
    lateral[i].chaos_n =
        Eigen::VectorXd::Constant(lateral[i].rows(), std::sqrt(meanSquare(sites_[records_ + i].chaos_n)));
  }
  // A model that moves nothing sideways predicts no lateral force.
  const auto sidewaysOf = [&](const Model& model, const Site& channel) -> Eigen::VectorXd {
    if (!actsSideways(model)) return Eigen::VectorXd::Zero(channel.rows());
    const Prediction& p = predictions.at(&model);
    return meanOf(channel, p.forces, p.delays_s[p.best]);
  };
  // As in the fit, the law and the size of an effect may be off. What it does to this record is taken to be how its
  // prediction differs from the baseline's.
  const auto logProbabilityOf = [&](const Model& model) {
    const Prediction& p = predictions.at(&model);
    ErrorModel allowed = errors;
    const bool changes_force = std::any_of(model.variants.begin(), model.variants.end(),
                                           [](const Variant* v) { return !v->effect->reading_only; });
    if (changes_force && o.ice_contact) {
      allowed.noise += computeFormCovariance(discrepancy_, o, p.curve() - without.curve());
    }
    // One delay would not do: where a curve rises a quarter of a second early there is nothing but noise to allow for
    // it.
    double sum = computeLogDensity(o.force_n, p.curves, p.log_weight, allowed);
    for (const Site& channel : lateral) {
      const Eigen::VectorXd curve = sidewaysOf(model, channel);
      ErrorModel sideways;
      sideways.noise = computeNoiseCovariance(channel.observation().noise, channel.observation().time_s) +
                       lateralDiscrepancy(channel, site) +
                       computeFormCovariance(discrepancy_, channel.observation(), curve);
      sideways.discrepancy = Eigen::MatrixXd::Zero(channel.rows(), channel.rows());
      sum += computeLogDensity(channel.observation().force_n, {curve}, {0.0}, sideways);
    }
    return sum;
  };
  const auto meanSquareOf = [&](const Model& model) {
    double sum = meanSquare(predictions.at(&model).curve() - o.force_n);
    for (const Site& channel : lateral) {
      sum += meanSquare(sidewaysOf(model, channel) - channel.observation().force_n);
    }
    return sum;
  };

  const double log_probability_without = logProbabilityOf(baseline), mean_square_without = meanSquareOf(baseline);
  predicted_.resize(models.size());
  for (std::size_t k = 0; k < models.size(); ++k) {
    if (predictions.count(&models[k]) == 0) continue;
    const Eigen::VectorXd& curve = predictions.at(&models[k]).curve();
    predicted_[k] = {curve, computeError(o, curve, covariance)};
    Explanation& e = result.ranking[k];
    e.holdout_rmse_n = predicted_[k].error.rmse_n;
    e.holdout_ratio = std::sqrt(meanSquareOf(models[k]) / mean_square_without);
    e.holdout_log_ratio = logProbabilityOf(models[k]) - log_probability_without;
  }
  RecordCurves& c = site.curves;
  c.baseline_n = site.mean_n;
  c.before = computeError(o, c.baseline_n, covariance);
  c.refitted_n = without.curve();
  c.refitted = computeError(o, c.refitted_n, covariance);
  c.total_sigma_n = covariance.diagonal().cwiseSqrt();
  result.holdout.push_back(c);
}

}  // namespace brash_ice_rig
