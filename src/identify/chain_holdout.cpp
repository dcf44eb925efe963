#include "brash_ice_rig/identify/chain.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

namespace brash_ice_rig {
namespace {

using Forces = std::vector<SimulatedForce>;

/// A record and its lateral channels, in one.
struct Channels {
  std::vector<Site> sites;  ///< the record first

  Eigen::VectorXd data() const {
    std::vector<Eigen::VectorXd> parts;
    for (const Site& site : sites) parts.push_back(site.observation().force_n);
    return stacked(parts);
  }
  /// Mean of some simulations. What moves nothing sideways predicts no lateral force.
  Eigen::VectorXd mean(const Forces& forces, double delay_s, bool sideways) const {
    std::vector<Eigen::VectorXd> parts;
    for (const Site& site : sites) {
      parts.push_back(Eigen::VectorXd::Zero(site.rows()));
      if (site.direction_rad && !sideways) continue;
      for (const SimulatedForce& f : forces) parts.back() += site.bins(f, delay_s) / static_cast<double>(forces.size());
    }
    return stacked(parts);
  }
  /// Sum of the channels' mean squares.
  double meanSquare(const Eigen::VectorXd& all) const {
    double sum = 0.0;
    Eigen::Index row = 0;
    for (const Site& site : sites) {
      sum += all.segment(row, site.rows()).squaredNorm() / static_cast<double>(site.rows());
      row += site.rows();
    }
    return sum;
  }
};

/// What a model says of another lift: what comes back as it was; what may come back or not; what comes back with
/// another phase. T: where the model has to be simulated to tell that, or the forces there.
template <typename T>
struct Parts {
  struct Swing {
    T with;           ///< this one and what always comes back
    double share;     ///< standard deviation of how much of it there is, as its phase is not known
    double size;      ///< of it in `with`, in the unit of its amplitude
    double period_s;  ///< of swell, whose sine and cosine follow one another; 0 of another swing
  };
  T always;
  std::optional<T> with_events;  ///< and what always comes back
  std::vector<Swing> swings;
  std::optional<T> found;      ///< with the swings as they seem to have been
  Eigen::VectorXd found_size;  ///< of each, over Swing::size
};

/// @param first_amplitude  among the model's unknowns
Parts<Eigen::VectorXd> partsOfUnknowns(const Model& model, Eigen::Index first_amplitude) {
  Eigen::VectorXd always = model.x, with_events = model.x;
  struct Size {
    Eigen::Index column;
    double size, share, period_s;
  };
  std::vector<Size> sizes;
  bool has_events = false;
  Eigen::Index first = first_amplitude;
  for (const Variant* v : model.variants) {
    const std::vector<Amplitude>& all = v->amplitudes;
    for (std::size_t k = 0; k < all.size(); ++k) {
      const Eigen::Index column = first + static_cast<Eigen::Index>(k);
      has_events = has_events || all[k].once;
      if (all[k].once || all[k].swing != 0) always[column] = 0.0;
      if (all[k].swing == 0) continue;
      with_events[column] = 0.0;
      double square = 0.0;
      int count = 0;
      for (std::size_t other = 0; other < all.size(); ++other) {
        if (all[other].swing != all[k].swing) continue;
        square += std::pow(model.x[first + static_cast<Eigen::Index>(other)], 2);
        ++count;
      }
      const double period_s = v->periods_s.empty() ? 0.0 : v->periods_s[static_cast<std::size_t>(all[k].swing - 1)];
      if (square > 0.0) sizes.push_back({column, std::sqrt(square), 1.0 / std::sqrt(count), period_s});
    }
    first += static_cast<Eigen::Index>(all.size());
  }
  Parts<Eigen::VectorXd> parts;
  parts.always = always;
  if (has_events) parts.with_events = with_events;
  for (const Size& s : sizes) {
    parts.swings.push_back({always, s.share, s.size, s.period_s});
    parts.swings.back().with[s.column] = s.size;
  }
  return parts;
}

/// A model without those of its effects that are zero at x, and what is left of x.
/// @param first_amplitude  among the unknowns
std::pair<std::vector<const Variant*>, Eigen::VectorXd> withoutZeros(const Model& model, const Eigen::VectorXd& x,
                                                                     Eigen::Index first_amplitude) {
  std::vector<const Variant*> variants;
  Eigen::VectorXd left = x.head(first_amplitude);
  Eigen::Index column = first_amplitude;
  for (const Variant* v : model.variants) {
    const auto count = static_cast<Eigen::Index>(v->amplitudes.size());
    const Eigen::VectorXd own = x.segment(column, count);
    column += count;
    if (own.isZero(0.0)) continue;
    variants.push_back(v);
    left.conservativeResize(left.size() + count);
    left.tail(count) = own;
  }
  return {variants, left};
}

/// The same way with swell of so many times its period.
LinearModel withLongerSwell(LinearModel way, const Site& site, const Parts<Forces>& parts, double delay_s,
                            double longer) {
  const CollectorConfig& rig = site.scenario.collector;
  const Eigen::VectorXd mass_kg =
      way.offset.head(site.rows()).cwiseMax(0.0).array() / kGravityMps2 + rig.mass_kg + rig.pole_mass_kg;
  const Eigen::VectorXd time_s = site.observation().time_s.array() - delay_s;
  for (std::size_t k = 0; k < parts.swings.size(); ++k) {
    const auto& swing = parts.swings[k];
    if (swing.period_s == 0.0) continue;
    auto columns = way.columns.block(0, static_cast<Eigen::Index>(k), site.rows(), 2);
    columns = swellResponse(columns, swing.period_s, swing.period_s * longer, time_s, mass_kg * swing.size);
    columns.topRows(site.restRows()).setZero();
    ++k;  // the cosine
  }
  return way;
}

bool swells(const Parts<Forces>& parts) {
  return std::any_of(parts.swings.begin(), parts.swings.end(), [](const auto& swing) { return swing.period_s > 0.0; });
}

/// Every way in which a record may come about: with each delay, with and without events, with swell of each period
/// near the expected one; the swings' sizes and phases are unknowns. One delay would not do: where a curve rises a
/// quarter of a second early there is only noise to allow for it. Nor would one period: a twentieth off, swell is out
/// of step within a lift.
/// @param longer      periods of swell over those of the fit, as expected
/// @param log_weight  out: of each way against the others
std::vector<LinearModel> waysOf(const Channels& channels, const Parts<Forces>& parts, bool sideways, double longer,
                                std::vector<double>& log_weight) {
  constexpr double kSigmaS = 0.5, kMostS = 1.5;
  constexpr int kSteps = 30;
  const std::vector<double> periods =
      swells(parts) ? std::vector<double>{0.95, 0.975, 1.0, 1.025, 1.05} : std::vector<double>{1.0};
  std::vector<LinearModel> ways;
  const auto count = static_cast<Eigen::Index>(parts.swings.size());
  for (int step = -kSteps; step <= kSteps; ++step) {
    const double delay_s = kMostS * step / kSteps;
    LinearModel way;
    way.offset = channels.mean(parts.always, delay_s, sideways);
    way.columns.resize(way.offset.size(), count);
    way.prior_mean = Eigen::VectorXd::Zero(count);
    way.prior_sigma.resize(count);
    way.positive.assign(parts.swings.size(), false);
    for (Eigen::Index k = 0; k < count; ++k) {
      const auto& swing = parts.swings[static_cast<std::size_t>(k)];
      way.columns.col(k) = channels.mean(swing.with, delay_s, sideways) - way.offset;
      // Straight lines say nothing of what swell does before the lift.
      if (swing.period_s > 0.0) way.columns.col(k).head(channels.sites.front().restRows()).setZero();
      way.prior_sigma[k] = swing.share;
    }
    Eigen::VectorXd events = Eigen::VectorXd::Zero(way.offset.size());
    if (parts.with_events) events = channels.mean(*parts.with_events, delay_s, sideways) - way.offset;
    if (parts.found) {
      way.offset = channels.mean(*parts.found, delay_s, sideways) - way.columns * parts.found_size;
    }
    const double log_prior = -0.5 * delay_s * delay_s / (kSigmaS * kSigmaS);
    for (const double period : periods) {
      ways.push_back(withLongerSwell(way, channels.sites.front(), parts, delay_s, longer * period));
      log_weight.push_back(log_prior);
      if (!parts.with_events) continue;
      ways.push_back(ways.back());
      ways.back().offset += events;
      log_weight.push_back(log_prior);
    }
  }
  return ways;
}

/// Adds what an effect's law may be off, for a change of the force of this size.
void addFormErrors(const Channels& channels, const Eigen::VectorXd& change, double timing_sigma_s, double weight,
                   Eigen::MatrixXd& noise) {
  Eigen::Index row = 0;
  for (const Site& channel : channels.sites) {
    noise.block(row, row, channel.rows(), channel.rows()) +=
        weight * computeFormCovariance(*channel.discrepancy, channel.observation(), change.segment(row, channel.rows()),
                                       timing_sigma_s);
    row += channel.rows();
  }
}

struct Prediction {
  double log_density = 0.0;
  Eigen::VectorXd mean_n;  ///< the most probable one, of all channels
  Eigen::VectorXd swings;  ///< in it: size of each over Parts::Swing::size
};

/// How probable a record is that was not fitted.
/// @param parts   what the model says of it
/// @param errors  what is allowed without an effect
/// @param longer  periods of swell over those of the fit
/// @return        none where the model freezes
std::optional<Prediction> predict(const Channels& channels, const Model& model, const Parts<Forces>& parts,
                                  const Eigen::VectorXd& without_n, ErrorModel errors, double longer) {
  const bool sideways = actsSideways(model);
  const auto freezes = [](const Parts<Forces>::Swing& s) { return s.with.empty(); };
  if (parts.always.empty() || std::any_of(parts.swings.begin(), parts.swings.end(), freezes)) return std::nullopt;
  const bool changes_force = std::any_of(model.variants.begin(), model.variants.end(),
                                         [](const Variant* v) { return !v->effect->reading_only; });
  if (changes_force && channels.sites.front().observation().ice_contact) {
    const Eigen::VectorXd always_n = channels.mean(parts.always, 0.0, sideways);
    const double timing_sigma_s = timingSigma(model);
    const Forces& largest = parts.with_events ? *parts.with_events : parts.always;
    addFormErrors(channels, channels.mean(largest, 0.0, sideways) - without_n, timing_sigma_s, 1.0, errors.noise);
    for (const auto& swing : parts.swings) {
      addFormErrors(channels, channels.mean(swing.with, 0.0, sideways) - always_n, timing_sigma_s,
                    swing.share * swing.share, errors.noise);
    }
  }
  const Eigen::VectorXd data = channels.data();
  std::vector<double> log_weight;
  const std::vector<LinearModel> ways = waysOf(channels, parts, sideways, longer, log_weight);
  Prediction p;
  p.log_density = computeLogDensity(data, ways, log_weight, errors);
  const FactoredErrors factored(errors, 1.0);
  double best = -std::numeric_limits<double>::infinity();
  const LinearModel* best_way = nullptr;
  for (std::size_t i = 0; i < ways.size(); ++i) {
    const double density = computeLogEvidence(data, ways[i], factored) + log_weight[i];
    if (density > best) {
      best = density;
      best_way = &ways[i];
    }
  }
  const LinearFit fit = fitLinear(data, *best_way, errors);
  p.mean_n = fit.mean;
  p.swings = fit.x;
  return p;
}

/// Straight lines tell how swell was in this record. What it does to a rig that knocks at the ice is no matter of
/// straight lines: there it is simulated. What predicts the record best counts.
/// @param by_lines  the former  @param unknown  where the parts were simulated
Prediction predictSwell(const Prediction& by_lines, Parts<Forces> parts, const Parts<Eigen::VectorXd>& unknown,
                        const std::function<Forces(const Eigen::VectorXd& at)>& simulated,
                        const std::function<std::optional<Prediction>(const Parts<Forces>&)>& predicted) {
  constexpr int kPasses = 2;
  Prediction best = by_lines, last = by_lines;
  for (int pass = 0; pass < kPasses; ++pass) {
    Eigen::VectorXd at = unknown.always;
    for (std::size_t i = 0; i < unknown.swings.size(); ++i) {
      at += last.swings[static_cast<Eigen::Index>(i)] * (unknown.swings[i].with - unknown.always);
    }
    const Forces found = simulated(at);
    if (found.empty()) break;
    parts.found = found;
    parts.found_size = last.swings;
    const std::optional<Prediction> with = predicted(parts);
    if (!with) break;
    last = *with;
    if (last.log_density > best.log_density) best = last;
  }
  return best;
}

/// While the hoist moves, m/s.
double meanSpeed(const HoistPath& path) {
  double way_m = 0.0, moving_s = 0.0;
  for (std::size_t i = 1; i < path.time_s.size(); ++i) {
    const double step_m = std::abs(path.height_m[i] - path.height_m[i - 1]);
    if (step_m == 0.0) continue;
    way_m += step_m;
    moving_s += path.time_s[i] - path.time_s[i - 1];
  }
  return moving_s > 0.0 ? way_m / moving_s : 0.0;
}

}  // namespace

/// What noise and simulator may be off in a record that was not fitted, of which its sites say how it is as given.
/// @param sites      the record first; its lateral channels get their scatter here
/// @param without_n  all channels as the baseline predicts them
ErrorModel Chain::heldOutErrors(std::vector<Site>& sites, const Eigen::VectorXd& without_n) const {
  ErrorModel errors;
  errors.noise = errors.discrepancy = Eigen::MatrixXd::Zero(without_n.size(), without_n.size());
  const Site& vertical = sites.front();
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < sites.size(); ++i) {
    Site& channel = sites[i];
    auto noise = errors.noise.block(row, row, channel.rows(), channel.rows());
    noise = computeNoiseCovariance(channel.observation().noise, channel.observation().time_s);
    if (i == 0 && vertical.observation().ice_contact) {
      errors.discrepancy.topLeftCorner(vertical.rows(), vertical.rows()) =
          discrepancyOf(vertical, without_n.head(vertical.rows()));
    } else if (i > 0) {
      // How arrangements of the blocks differ sideways is known from the first record.
      const Eigen::VectorXd& known_n = sites_[records_ + i - 1].chaos_n;
      channel.chaos_n = Eigen::VectorXd::Constant(
          channel.rows(), std::sqrt(known_n.squaredNorm() / static_cast<double>(known_n.size())));
      noise += lateralDiscrepancy(channel, vertical);
    }
    row += channel.rows();
  }
  return errors;
}

/// Predicts a record that was not fitted. When the rim meets the ice is a matter of the spot, and the phase of a swell
/// and whether blocks fall a matter of the moment: these are open, for every model alike.
void Chain::evaluateHoldout(const Model& baseline, const std::vector<Model>& models, Identification& result) {
  Channels channels;
  channels.sites.push_back(makeSite(*input_.holdout));
  const std::vector<Site> lateral = lateralSites(channels.sites.front());
  channels.sites.insert(channels.sites.end(), lateral.begin(), lateral.end());
  Site& site = channels.sites.front();
  const Observation& o = site.observation();

  Model given;
  given.x = Eigen::VectorXd::Zero(unknowns());
  const auto forcesAt = [&](const Model& model, const Eigen::VectorXd& at, bool request_only) {
    const auto [variants, x] = withoutZeros(model, at, unknowns());
    Forces forces;
    for (int seed = 1; seed <= kPairs; ++seed) {
      const Scenario s = scenarioAt(site, x, variants, seed);
      const std::string key = runs_.request(s);
      if (request_only || runs_.failed(key)) continue;
      forces.push_back(&model == &given ? runs_.force(key) : asRead(corrected(site, key), s, x, variants));
    }
    return forces;
  };
  const auto partsOf = [&](const Model& model, bool request_only) {
    const Parts<Eigen::VectorXd> unknown = partsOfUnknowns(model, unknowns());
    Parts<Forces> parts;
    parts.always = forcesAt(model, unknown.always, request_only);
    if (unknown.with_events) parts.with_events = forcesAt(model, *unknown.with_events, request_only);
    if (parts.with_events && parts.with_events->empty()) parts.with_events.reset();
    for (const auto& swing : unknown.swings) {
      parts.swings.push_back({forcesAt(model, swing.with, request_only), swing.share, swing.size, swing.period_s});
    }
    return parts;
  };
  // What the evidence speaks against needs no prediction.
  std::vector<std::size_t> worth;
  for (std::size_t k = 0; k < models.size(); ++k) {
    if (models[k].simulated && result.ranking[k].log_bayes_factor > 0.0) worth.push_back(k);
  }
  partsOf(given, true);
  partsOf(baseline, true);
  for (const std::size_t k : worth) partsOf(models[k], true);
  runs_.makeMissing("held-out record");

  const Parts<Forces> given_parts = partsOf(given, false), baseline_parts = partsOf(baseline, false);
  if (given_parts.always.empty() || baseline_parts.always.empty()) return;
  site.mean_n = channels.mean(given_parts.always, 0.0, false).head(site.rows());
  site.chaos_n = site.known_share = Eigen::VectorXd::Zero(site.rows());
  if (o.ice_contact) site.known_share = computeKnownShare(*site.discrepancy, o.path, o.time_s, o.way_m);
  const Eigen::VectorXd data = channels.data(), without_n = channels.mean(baseline_parts.always, 0.0, false);
  const ErrorModel errors = heldOutErrors(channels.sites, without_n);
  const Eigen::MatrixXd covariance = (errors.noise + errors.discrepancy).topLeftCorner(site.rows(), site.rows());
  const auto predicted = [&](const Model& model, const Parts<Forces>& parts, double longer = 1.0) {
    return predict(channels, model, parts, without_n, errors, longer);
  };
  const auto errorOf = [&](const Prediction& p) { return computeError(o, p.mean_n.head(site.rows()), covariance); };

  const Prediction as_given = *predicted(given, given_parts), without = *predicted(baseline, baseline_parts);
  constexpr double kSpeedsDiffer = 0.12;  // or both would be among the periods that are tried
  const double speed = meanSpeed(o.path);
  const double slower = speed > 0.0 ? meanSpeed(sites_.front().observation().path) / speed : 1.0;
  predicted_.resize(models.size());
  for (const std::size_t k : worth) {
    const Model& model = models[k];
    const Parts<Forces> parts = partsOf(model, false);
    std::optional<Prediction> with = predicted(model, parts);
    if (!with) continue;
    const Prediction by_lines = *with;
    if (swells(parts)) {
      const auto simulated = [&](const Eigen::VectorXd& at) {
        forcesAt(model, at, true);
        runs_.makeMissing("held-out record, swell as it was there");
        return forcesAt(model, at, false);
      };
      with = predictSwell(by_lines, parts, partsOfUnknowns(model, unknowns()), simulated,
                          [&](const Parts<Forces>& there) { return predicted(model, there); });
    }
    predicted_[k] = {with->mean_n.head(site.rows()), errorOf(*with)};
    Explanation& e = result.ranking[k];
    e.holdout_rmse_n = predicted_[k].error.rmse_n;
    e.holdout_ratio = std::sqrt(channels.meanSquare(with->mean_n - data) / channels.meanSquare(without.mean_n - data));
    e.holdout_log_ratio = with->log_density - without.log_density;
    // The sea's period is about the same in a slower lift, a drum's is not.
    if (!swells(parts) || std::abs(std::log(slower)) < kSpeedsDiffer) continue;
    // Both by straight lines: what is simulated where it fits best has an advantage.
    e.holdout_way_log_ratio = e.holdout_log_ratio + predicted(model, parts, slower)->log_density - by_lines.log_density;
  }
  RecordCurves& c = site.curves;
  c.baseline_n = as_given.mean_n.head(site.rows());
  c.before = errorOf(as_given);
  c.refitted_n = without.mean_n.head(site.rows());
  c.refitted = errorOf(without);
  c.total_sigma_n = covariance.diagonal().cwiseSqrt();
  result.holdout.push_back(c);
}

}  // namespace brash_ice_rig
