#include "brash_ice_rig/identify/chain.h"

#include <algorithm>

namespace brash_ice_rig {

LinearModel Chain::linearModel(const Model& model) const {
  LinearModel m;
  m.offset = model.offset;
  const Eigen::Index own = unknowns(), count = own + model.effect_columns.cols();
  m.columns.resize(data_.size(), count);
  m.columns << baseline_columns_, model.effect_columns;
  m.prior_mean = Eigen::VectorXd::Zero(count);
  m.prior_sigma.resize(count);
  m.positive.assign(static_cast<std::size_t>(count), false);
  for (std::size_t k = 0; k < ice_.size(); ++k) m.prior_sigma[static_cast<Eigen::Index>(k)] = ice_[k].sigma;
  for (std::size_t i = 0; i < records_; ++i) {
    m.prior_sigma[sites_[i].own()] = kGapSigmaM;
    m.prior_sigma[sites_[i].own() + 1] = sites_[i].observation().clock_sigma_s;
  }
  Eigen::Index column = own;
  for (const Variant* v : model.variants) {
    for (const Amplitude& a : v->amplitudes) {
      m.prior_mean[column] = a.prior_mean;
      m.prior_sigma[column] = a.prior_sigma;
      m.positive[static_cast<std::size_t>(column)] = a.positive;
      ++column;
    }
  }
  return m;
}

/// Covariance of what the law of a model's effects may be off at these amplitudes.
/// A load cell's bias or scale has no other law: with that freedom, a little of it would explain anything smooth.
Eigen::MatrixXd Chain::formErrors(const Model& model, const Eigen::VectorXd& amplitudes) const {
  Eigen::VectorXd change = Eigen::VectorXd::Zero(data_.size());
  Eigen::Index column = 0;
  for (const Variant* v : model.variants) {
    const auto count = static_cast<Eigen::Index>(v->amplitudes.size());
    if (!v->effect->reading_only) {
      change += model.effect_columns.middleCols(column, count) * amplitudes.segment(column, count);
    }
    column += count;
  }
  Eigen::MatrixXd form = Eigen::MatrixXd::Zero(data_.size(), data_.size());
  for (const Site& site : sites_) {
    if (!site.observation().ice_contact) continue;
    form.block(site.first_row, site.first_row, site.rows(), site.rows()) = computeFormCovariance(
        *site.discrepancy, site.observation(), change.segment(site.first_row, site.rows()), timingSigma(model));
  }
  return form;
}

/// How far an effect's law may be off depends on how much of it there is. That is integrated over one amplitude; with
/// several, they are fitted twice.
void Chain::refit(Model& model) const {
  const LinearModel m = linearModel(model);
  const Eigen::Index amplitudes = model.effect_columns.cols();
  if (amplitudes == 1 && !model.variants[0]->effect->reading_only) {
    const Eigen::MatrixXd form = formErrors(model, Eigen::VectorXd::Ones(1));
    model.fit = fitWithForm(data_, m, errors_, unknowns(), form, model.density);
    return;
  }
  if (amplitudes == 0 || model.fit.x.size() != m.columns.cols()) model.fit = fitLinear(data_, m, errors_);
  if (amplitudes == 0) return;
  ErrorModel errors = errors_;
  errors.noise += formErrors(model, model.fit.x.tail(amplitudes));
  model.fit = fitLinear(data_, m, errors);
}

/// Adds an effect, as a straight line, to those that a model has; it is to be fitted again.
/// @param columns  what each of its amplitudes does, per unit
void Chain::addEffect(Model& model, const Variant& v, const Eigen::MatrixXd& columns) const {
  model.variants.push_back(&v);
  model.effect_columns.conservativeResize(data_.size(), model.effect_columns.cols() + columns.cols());
  model.effect_columns.rightCols(columns.cols()) = columns;
  const auto located = located_log_odds_.find(&v);
  if (located != located_log_odds_.end()) model.shape_log_odds += located->second;
  model.simulated = false;
}

/// The baseline with one effect or none, as straight lines.
Model Chain::linear(const Variant* variant) const {
  Model model;
  model.offset = baseline_offset_;
  model.effect_columns.resize(data_.size(), 0);
  if (variant != nullptr) addEffect(model, *variant, signatures_.at(variant));
  refit(model);
  return model;
}

/// Within what can be simulated.
Eigen::VectorXd Chain::clipped(const Model& model, Eigen::VectorXd x) const {
  for (std::size_t k = 0; k < ice_.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    x[i] = std::clamp(ice_[k].prior + x[i], ice_[k].low, ice_[k].high) - ice_[k].prior;
  }
  for (std::size_t i = 0; i < records_; ++i) {
    x[sites_[i].own()] = std::max(x[sites_[i].own()], -sites_[i].scenario.procedure.start_gap_m);
  }
  Eigen::Index column = unknowns();
  for (const Variant* v : model.variants) {
    for (const Amplitude& a : v->amplitudes) {
      x[column] = std::clamp(x[column], a.least, a.most);
      ++column;
    }
  }
  return x;
}

/// The force of a model at x in all bins, mean over the pairs' seeds; none where the world freezes.
std::optional<Eigen::VectorXd> Chain::simulated(const Model& model, const Eigen::VectorXd& x, bool request_only) {
  std::vector<Eigen::VectorXd> parts;
  const bool sideways = actsSideways(model);
  for (const Site& site : sites_) {
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(site.rows());
    const int seeds = site.direction_rad && !sideways ? 0 : site.observation().ice_contact ? kPairs : 1;
    const double delay = x[site.own() + 1];
    for (int seed = 1; seed <= seeds; ++seed) {
      const Scenario s = scenarioAt(site, x, model.variants, seed);
      try {
        s.validate();
      } catch (const ConfigError&) {
        return std::nullopt;
      }
      const std::string key = runs_.request(s);
      if (request_only) continue;
      if (runs_.failed(key)) return std::nullopt;
      mean += site.bins(asRead(corrected(site, key), s, x, model.variants), delay) / seeds;
    }
    parts.push_back(mean);
  }
  return stacked(parts);
}

/// Gauss-Newton with the slopes of the signatures: simulate where the fit is, and fit again around that.
void Chain::confirm(const std::vector<Model*>& models, const std::string& what) {
  for (Model* model : models) {
    if (model->frozen) continue;
    model->x = clipped(*model, model->fit.x);
    if (!simulated(*model, model->x, true)) model->frozen = true;
  }
  runs_.makeMissing(what);
  for (Model* model : models) {
    if (model->frozen) continue;
    const std::optional<Eigen::VectorXd> curve = simulated(*model, model->x, false);
    if (!curve) {
      model->frozen = true;
      continue;
    }
    model->simulated = true;
    model->curve_n = *curve;
    model->offset = *curve - linearModel(*model).columns * model->x;
    refit(*model);
    fitReading(*model);
  }
}

/// What the effects of a model do to the force at x: by straight lines, but for what only the load cell does.
Eigen::VectorXd Chain::changeBy(const Model& model, const Eigen::VectorXd& x) {
  Eigen::VectorXd along_slopes = x.tail(model.effect_columns.cols()), unread = model.x;
  bool reads = false;
  Eigen::Index column = 0;
  for (const Variant* v : model.variants) {
    const auto count = static_cast<Eigen::Index>(v->amplitudes.size());
    if (v->effect->reading_only && !model.frozen) {
      unread.segment(unknowns() + column, count).setZero();
      along_slopes.segment(column, count).setZero();
      reads = true;
    }
    column += count;
  }
  const Eigen::VectorXd change = model.effect_columns * along_slopes;
  return reads ? Eigen::VectorXd(change + model.curve_n - *simulated(model, unread, false)) : change;
}

/// What only the load cell does to a force needs no simulation: at those of model.x its amplitudes are fitted to the
/// end, with slopes of where they are. A straight line about a cell without lag makes little of a long one.
void Chain::fitReading(Model& model) {
  constexpr int kReadings = 10;
  constexpr double kStepShare = 0.05, kSettled = 0.1;  // of an amplitude's usual step, and of its standard deviation
  std::vector<std::pair<Eigen::Index, const Amplitude*>> own;  // of such effects, with their place in x
  Eigen::Index column = unknowns();
  for (const Variant* v : model.variants) {
    for (const Amplitude& a : v->amplitudes) {
      if (v->effect->reading_only) own.emplace_back(column, &a);
      ++column;
    }
  }
  bool settled = own.empty();
  for (int reading = 0; reading < kReadings && !settled; ++reading) {
    const Eigen::VectorXd fitted = clipped(model, model.fit.x);
    for (const auto& [k, amplitude] : own) model.x[k] = fitted[k];
    model.curve_n = *simulated(model, model.x, false);
    for (const auto& [k, amplitude] : own) {
      const double away = kStepShare * amplitude->step, step = model.x[k] + away > amplitude->most ? -away : away;
      Eigen::VectorXd beside = model.x;
      beside[k] += step;
      model.effect_columns.col(k - unknowns()) = (*simulated(model, beside, false) - model.curve_n) / step;
    }
    model.offset = model.curve_n - linearModel(model).columns * model.x;
    refit(model);
    settled = std::all_of(own.begin(), own.end(), [&](const auto& one) {
      const Eigen::Index k = one.first;
      const double left = clipped(model, model.fit.x)[k] - model.x[k];
      return std::abs(left) <= kSettled * std::sqrt(model.fit.covariance(k, k));
    });
  }
}

}  // namespace brash_ice_rig
