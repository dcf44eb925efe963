#include "brash_ice_rig/identify/chain.h"
#include "brash_ice_rig/math/angle.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace brash_ice_rig {
namespace {

/// Swell whose effect is simulated in order to know what others would do.
constexpr double kSwellPeriodS = 6.0;

}  // namespace

void Chain::addVariants() {
  // A position that was only commanded in one of the records leaves the hoist's losses open.
  PositionOrigin position = PositionOrigin::kMeasured;
  for (const Site& site : sites_) {
    if (site.curves.record.position == PositionOrigin::kCommanded) position = PositionOrigin::kCommanded;
  }
  for (const EffectDescription& effect : effectRegistry()) {
    if (sites_.front().scenario.effects[effect.name].enabled) continue;  // the baseline has it already
    if (lateral_direction_deg_ && std::string(effect.name) == "pole_tilt") {
      addTilts();
      continue;
    }
    for (Variant& variant : makeVariants(effect, position)) {
      variants_.push_back(std::make_unique<Variant>(std::move(variant)));
    }
    if (std::string(effect.name) == "vessel_heave" && sites_.front().observation().ice_contact) {
      swell_ = std::make_unique<Variant>(makeSwell({kSwellPeriodS}, false));
      settled_.insert(swell_.get());
    }
    for (const auto& [v, amplitude] : typicalAmplitudes(effect)) settled_.insert(v);
  }
}

/// pole_tilt for a record with lateral channels. They show the way of a leaning pole, which is simulated where there is
/// one: see locateTilt().
void Chain::addTilts() {
  const Site& site = sites_.front();
  const Observation& o = site.observation();
  const CollectorConfig& rig = site.scenario.collector;
  const double direction = *lateral_direction_deg_ * kDegree;
  leaning_ = makeLeaningTilts(*lateral_direction_deg_, rig.pole_length_m, o.time_s,
                              o.force_n.array() + (rig.mass_kg + rig.pole_mass_kg) * kGravityMps2,
                              o.lateral_n * Eigen::Vector2d(std::cos(direction), std::sin(direction)));
  for (Variant& upright : makeUprightTilts(*lateral_direction_deg_)) {
    variants_.push_back(std::make_unique<Variant>(std::move(upright)));
  }
}

/// Each amplitude of an effect once, with the variant from which it is told how large it must be to be seen: the middle
/// of its shapes, or the first that has it.
std::vector<std::pair<const Variant*, std::size_t>> Chain::typicalAmplitudes(const EffectDescription& effect) const {
  std::vector<const Variant*> own;
  for (const auto& v : variants_) {
    if (v->effect == &effect) own.push_back(v.get());
  }
  if (own.empty()) return {};
  const Variant* middle = own[own.size() / 2];
  own.insert(own.begin(), middle);
  std::vector<std::pair<const Variant*, std::size_t>> typical;
  std::set<std::string> told;
  for (const Variant* v : own) {
    for (std::size_t k = 0; k < v->amplitudes.size(); ++k) {
      if (told.insert(v->amplitudes[k].name).second) typical.emplace_back(v, k);
    }
  }
  return typical;
}

/// Keys of the runs with each amplitude at its step, seed by seed; empty where no run is needed or none is possible.
std::vector<std::string> Chain::requestSignature(const Site& site, const Variant& v) {
  if (v.effect->reading_only || !site.observation().ice_contact) return {};
  std::vector<std::string> keys;
  for (std::size_t k = 0; k < v.amplitudes.size(); ++k) {
    for (int seed = 1; seed <= pairsOf(v); ++seed) {
      Scenario s = site.scenario;
      s.field.seed = static_cast<std::uint64_t>(seed);
      Eigen::VectorXd a = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(v.amplitudes.size()));
      a[static_cast<Eigen::Index>(k)] = v.amplitudes[k].step;
      site.apply(v, a, s);
      try {
        s.validate();
      } catch (const ConfigError&) {
        return {};  // such an amplitude is impossible in this ice
      }
      keys.push_back(runs_.request(s));
    }
  }
  return keys;
}

/// What each amplitude does to the force on one arrangement of the blocks, per unit.
/// @param keys  of the variant's runs, as requestSignature() has them
Eigen::MatrixXd Chain::signature(const Site& site, const Variant& v, const std::vector<std::string>& keys, int seed) {
  const auto count = static_cast<Eigen::Index>(v.amplitudes.size());
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(site.rows(), count);
  if (site.direction_rad && !v.effect->acts_sideways) return columns;
  const SimulatedForce plain = corrected(site, requestBaseline(site, std::min(seed, site.seeds())));
  const Eigen::VectorXd before = site.bins(plain);
  for (Eigen::Index k = 0; k < count; ++k) {
    const double step = v.amplitudes[static_cast<std::size_t>(k)].step;
    if (v.effect->reading_only) {
      Eigen::VectorXd a = Eigen::VectorXd::Zero(count);
      a[k] = step;
      EffectValues values(*v.effect);
      v.apply(values, a);
      columns.col(k) = (site.bins(throughLoadCell(values, site.scenario, plain)) - before) / step;
    } else if (!keys.empty()) {
      const std::string& key = keys[static_cast<std::size_t>(k * pairsOf(v) + seed - 1)];
      if (!runs_.failed(key)) columns.col(k) = (site.bins(corrected(site, key)) - before) / step;
    }
  }
  if (v.hangs_clear) columns.topRows(site.restRows()).setZero();
  return columns;
}

/// The same of all records, on each arrangement.
std::vector<Eigen::MatrixXd> Chain::signaturesOf(const Variant& v) {
  const auto count = static_cast<Eigen::Index>(v.amplitudes.size());
  std::vector<Eigen::MatrixXd> all(static_cast<std::size_t>(pairsOf(v)), Eigen::MatrixXd(data_.size(), count));
  for (const Site& site : sites_) {
    const std::vector<std::string> keys = requestSignature(site, v);
    for (std::size_t k = 0; k < all.size(); ++k) {
      all[k].middleRows(site.first_row, site.rows()) = signature(site, v, keys, static_cast<int>(k) + 1);
    }
  }
  return all;
}

void Chain::computeSignatures(const std::vector<const Variant*>& variants, const std::string& what) {
  for (const Variant* v : variants) {
    for (const Site& site : sites_) requestSignature(site, *v);
  }
  runs_.makeMissing(what);
  for (const Variant* v : variants) {
    const std::vector<Eigen::MatrixXd> all = signaturesOf(*v);
    signatures_[v] = all.front();
    for (std::size_t k = 1; k < all.size(); ++k) signatures_[v] += all[k];
    signatures_[v] /= static_cast<double>(all.size());
  }
}

/// Takes signatures on all pairs where one was enough so far.
/// @return whether there were any
bool Chain::settle(std::vector<const Variant*> variants) {
  variants.erase(
      std::remove_if(variants.begin(), variants.end(), [this](const Variant* v) { return !settled_.insert(v).second; }),
      variants.end());
  if (variants.empty()) return false;
  computeSignatures(variants, "what the best explanations do, once more");
  return true;
}

/// Looks for causes of one kind that may be at many places: one after the other, each where it explains most, at most
/// three, as long as each earns its place.
/// @param places     at which one may be
/// @param prior      of each column's unknown
/// @param columns    what it does to the force of the first record from a place, per unit
/// @param found      out
/// @param log_odds   out: what having looked at many places costs
/// @return ln of the Bayes factor of all of them together
double Chain::findPlaces(const Model& start, const std::vector<double>& places, const Amplitude& prior,
                         const std::function<Eigen::MatrixXd(double)>& columns, std::vector<double>& found,
                         double& log_odds) const {
  constexpr double kGain = 2.0;
  const Site& site = sites_.front();
  found.clear();
  log_odds = 0.0;
  double total = 0.0;
  if (places.empty()) return total;
  LinearModel model = linearModel(start);
  // At the start's kappa: a trial moves it only a little.
  const FactoredErrors errors(errors_, start.fit.kappa);
  double before = computeLogEvidence(data_, model, errors);
  const Eigen::Index added = columns(places.front()).cols();
  while (found.size() < 3) {
    std::vector<double> gains;
    LinearModel trial = model;
    const Eigen::Index column = model.columns.cols();
    trial.columns.conservativeResize(Eigen::NoChange, column + added);
    trial.prior_mean.conservativeResize(column + added);
    trial.prior_sigma.conservativeResize(column + added);
    trial.prior_mean.tail(added).setConstant(prior.prior_mean);
    trial.prior_sigma.tail(added).setConstant(prior.prior_sigma);
    trial.positive.resize(static_cast<std::size_t>(column + added), prior.positive);
    LinearModel best = trial;
    double best_evidence = -std::numeric_limits<double>::infinity();
    for (const double place : places) {
      trial.columns.rightCols(added).setZero();
      trial.columns.block(site.first_row, column, site.rows(), added) = columns(place);
      const double evidence = computeLogEvidence(data_, trial, errors);
      gains.push_back(evidence - before);
      if (evidence > best_evidence) {
        best_evidence = evidence;
        best = trial;
      }
    }
    const double mean_gain = logMeanExp(gains);
    const auto top = static_cast<std::size_t>(std::max_element(gains.begin(), gains.end()) - gains.begin());
    if (mean_gain < kGain && !found.empty()) return total;
    found.push_back(places[top]);
    total += mean_gain;
    log_odds += mean_gain - gains[top];
    before = best_evidence;
    model = best;
    if (mean_gain < kGain) return total;
  }
  return total;
}

const Variant* Chain::addLocated(Variant variant, double log_odds) {
  variants_.push_back(std::make_unique<Variant>(std::move(variant)));
  located_log_odds_[variants_.back().get()] = log_odds;
  return variants_.back().get();
}

/// Falls of ice at the times that the first record suggests, if any.
std::vector<const Variant*> Chain::locateFalls(const Model& start) {
  constexpr double kGridS = 0.5;
  const Site& site = sites_.front();
  if (EffectsConfig(site.scenario.effects)["block_drop"].enabled) return {};
  std::vector<double> times;
  const double end = site.observation().time_s[site.rows() - 1];
  for (int k = 0; 1.0 + k * kGridS < end - 1.0; ++k) times.push_back(1.0 + k * kGridS);
  const auto columns = [&](double time) -> Eigen::MatrixXd { return fallTemplate(time, site.observation().time_s); };
  std::vector<double> places;
  double log_odds = 0.0;
  if (findPlaces(start, times, makeFalls({0.0}).amplitudes[0], columns, places, log_odds) <= 0.0) return {};
  std::sort(places.begin(), places.end());
  return {addLocated(makeFalls(places), log_odds)};
}

/// Swell of the periods that the first record suggests, if any.
std::vector<const Variant*> Chain::locateSwell(const Model& start) {
  if (!swell_) return {};
  constexpr double kShortestS = 3.0, kLongestS = 14.0, kRatio = 1.06, kStepsPerS = 20.0;
  const Site& site = sites_.front();
  std::vector<double> periods;
  for (int k = 0;; ++k) {
    const double period = kShortestS * std::pow(kRatio, k);
    if (period >= kLongestS) break;
    periods.push_back(std::round(period * kStepsPerS) / kStepsPerS);
  }
  const Eigen::MatrixXd response = signatures_.at(swell_.get()).middleRows(site.first_row, site.rows());
  if (response.isZero()) return {};
  const CollectorConfig& rig = site.scenario.collector;
  const Eigen::VectorXd mass_kg = site.mean_n.cwiseMax(0.0).array() / kGravityMps2 + rig.mass_kg + rig.pole_mass_kg;
  std::vector<const Variant*> added;
  // Whether a rig knocks at the ice before the lift is a matter of centimetres.
  for (const bool hangs_clear : {false, true}) {
    if (hangs_clear && site.restRows() == 0) continue;
    const auto columns = [&](double period) {
      Eigen::MatrixXd swell = swellResponse(response, kSwellPeriodS, period, site.observation().time_s, mass_kg);
      if (hangs_clear) swell.topRows(site.restRows()).setZero();
      return swell;
    };
    std::vector<double> places;
    double log_odds = 0.0;
    if (findPlaces(start, periods, swell_->amplitudes[0], columns, places, log_odds) > 0.0) {
      added.push_back(addLocated(makeSwell(places, hangs_clear), log_odds));
    }
  }
  return added;
}

/// What the lateral channels show of a leaning pole, in all rows.
Eigen::MatrixXd Chain::sidewaysOnly(const Variant& leaning) const {
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(data_.size(), leaning.lateral_n.cols());
  for (const Site& site : sites_) {
    if (!site.direction_rad) continue;
    const double share = std::cos(*site.direction_rad - *lateral_direction_deg_ * kDegree);
    for (Eigen::Index i = 0; i < site.rows(); ++i) {
      columns.row(site.first_row + i) = share * leaning.lateral_n.row(i * kLateralThinning);
    }
  }
  return columns;
}

/// The way of a leaning pole that the lateral channels show, if any.
std::vector<const Variant*> Chain::locateTilt(const Model& start) {
  // At the start's kappa: see findPlaces().
  const FactoredErrors errors(errors_, start.fit.kappa);
  const double before = computeLogEvidence(data_, linearModel(start), errors);
  std::vector<double> gains;
  for (const Variant& way : leaning_) {
    Model trial = start;
    addEffect(trial, way, sidewaysOnly(way));
    gains.push_back(computeLogEvidence(data_, linearModel(trial), errors) - before);
  }
  if (gains.empty()) return {};
  const auto best = static_cast<std::size_t>(std::max_element(gains.begin(), gains.end()) - gains.begin());
  const double mean_gain = logMeanExp(gains);
  if (mean_gain <= 0.0) return {};
  return {addLocated(leaning_[best], mean_gain - gains[best])};
}

/// Adds a tilt of the pole, falls, and swell where the record suggests them, beside what a model has already: none of
/// what it has. A quick look has no time for places.
void Chain::locate(const Model& start, const std::string& what) {
  if (!sites_.front().observation().ice_contact) return;
  std::vector<const Variant*> added;
  const auto add = [&added](const std::vector<const Variant*>& found) {
    added.insert(added.end(), found.begin(), found.end());
  };
  if (!hasEffect(start, "pole_tilt")) add(locateTilt(start));
  if (!input_.screen_only) {
    if (!hasEffect(start, "block_drop")) add(locateFalls(start));
    if (!hasEffect(start, "vessel_heave")) add(locateSwell(start));
  }
  // Falls and tilts that the record suggests mostly go on to be confirmed, which asks for all pairs: at once, or cores
  // would wait for one run, twice. Of swell there are two ways, and one of them goes on.
  for (const Variant* v : added) {
    if (v->periods_s.empty()) settled_.insert(v);
  }
  computeSignatures(added, what);
}

}  // namespace brash_ice_rig
