#include "brash_ice_rig/identify/chain.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include "brash_ice_rig/identify/overlay.h"

namespace brash_ice_rig {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Central 95 % of an amplitude, over all shapes of the effect. What the simulation of the best shape changed of its
/// amplitude and evidence is taken to hold for the others.
std::pair<double, double> amplitudeInterval(const Model& model) {
  const Eigen::Index last = model.fit.x.size() - 1;
  const double shift = model.fit.x[last] - model.screened_fit.x[last];
  const double gain = model.fit.log_evidence - model.screened_fit.log_evidence;
  std::vector<UnknownDensity> all{model.density};
  for (const UnknownDensity& screened : model.other_shapes) {
    UnknownDensity moved;
    for (std::size_t i = 0; i < screened.value.size(); ++i) {
      const double value = screened.value[i] + shift;
      if (model.variants[0]->amplitudes[0].positive && value < 0.0) continue;
      moved.value.push_back(value);
      moved.log_density.push_back(screened.log_density[i] + gain);
    }
    if (moved.value.size() > 1) all.push_back(moved);
  }
  return {computeQuantile(all, 0.025), computeQuantile(all, 0.975)};
}

}  // namespace

Explanation Chain::explain(const Model& model, const Model& baseline, const Detectability& detectability) {
  Explanation e;
  e.holdout_rmse_n = e.holdout_ratio = e.holdout_log_ratio = e.holdout_way_log_ratio = kNaN;
  for (const Variant* v : model.variants) {
    e.effects.emplace_back(v->effect->name);
    e.shape += (e.shape.empty() ? "" : "; ") + v->label;
    e.threshold = std::max(e.threshold, thresholds_.of(v->effect->name));
  }
  e.confirmed = model.simulated;
  // The baseline's evidence has changed since those were screened that nobody simulated.
  e.log_bayes_factor = model.simulated ? score(model) - baseline.fit.log_evidence : model.screened;
  e.chi2_per_bin = chi2PerBin(model);
  // What moves the rig sideways acts on the vertical force as well: nothing is explained before that is.
  const Eigen::Index lateral_rows = data_.size() - record_rows_;
  const bool seen_sideways = baseline.fit.whitened.tail(lateral_rows).squaredNorm() > static_cast<double>(lateral_rows);
  const Eigen::Index rows = seen_sideways ? data_.size() : record_rows_;
  const double before = baseline.fit.whitened.head(rows).squaredNorm(), excess = before - static_cast<double>(rows);
  e.explained_ratio = excess > 0.0 ? (before - model.fit.whitened.head(rows).squaredNorm()) / excess : kNaN;
  e.portmanteau_p = computeLjungBox(whitened(model), kPortmanteauLags);
  const Eigen::VectorXd x = model.simulated ? model.x : model.fit.x;
  e.detectability = detectability.of(changeBy(model, x));
  const auto missed = [&](const Model& m, Eigen::Index count) {
    return (data_ - (m.simulated ? m.curve_n : m.fit.mean)).head(count).squaredNorm();
  };
  e.rmse_n = std::sqrt(missed(model, record_rows_) / static_cast<double>(record_rows_));
  e.error_ratio = std::sqrt(missed(model, rows) / missed(baseline, rows));
  Eigen::Index column = unknowns();
  for (const Variant* v : model.variants) {
    const auto count = static_cast<Eigen::Index>(v->amplitudes.size());
    for (const ParameterEstimate& p :
         v->estimate(x.segment(column, count), model.fit.covariance.block(column, column, count, count))) {
      e.parameters.push_back(p);
    }
    column += count;
  }
  if (model.variants.size() == 1 && !model.density.value.empty()) {
    ParameterEstimate& p = e.parameters.front();
    std::tie(p.low, p.high) = amplitudeInterval(model);
    if (x[unknowns()] < 0.0 && p.value > 0.0) {  // told by its size
      std::tie(p.low, p.high) = std::make_pair(std::max(-p.high, 0.0), -p.low);
    }
  }
  for (std::size_t k = 0; k < ice_.size(); ++k) {
    e.baseline.push_back(ice_[k].prior + x[static_cast<Eigen::Index>(k)]);
  }
  for (std::size_t i = 0; i < records_; ++i) {
    e.baseline.push_back(sites_[i].scenario.procedure.start_gap_m + x[sites_[i].own()]);
    e.baseline.push_back(x[sites_[i].own() + 1]);
  }
  if (model.frozen) e.note = "the simulation with it freezes or is refused: it could not be confirmed";
  return e;
}

void Chain::addDetectable(Identification& result, const Detectability& detectability) {
  struct Seen {
    const EffectDescription* effect;
    Eigen::VectorXd change;
  };
  std::vector<Seen> seen;
  std::set<std::string> told;
  const auto add = [&](const EffectDescription& effect, const Amplitude& amplitude,
                       const std::vector<Eigen::VectorXd>& columns) {
    const double per_unit = detectability.ofRepeats(columns);
    DetectableMagnitude m;
    m.effect = effect.name;
    for (const EffectParameter& p : effect.parameters) {
      const std::string name = p.name;
      if (amplitude.name.compare(0, name.size(), name) == 0)
        m.unit = p.unit, m.key = "effects." + m.effect + "." + name;
    }
    m.value = per_unit > 0.0 ? thresholds_.detectability / per_unit : kNaN;
    m.expected_detectability = per_unit * std::max(amplitude.prior_sigma, std::abs(amplitude.prior_mean));
    if (told.insert(m.key).second) {
      result.minimum_detectable.push_back(m);
      if (m.expected_detectability <= 1.0) return;
      seen.push_back({&effect, Eigen::VectorXd::Zero(data_.size())});
      for (const Eigen::VectorXd& column : columns) seen.back().change += column;
    }
  };
  // On each arrangement of the blocks: of the scatter among them, much is left in the mean of two.
  const auto columnOn = [this](const Variant& v, std::size_t amplitude) {
    std::vector<Eigen::VectorXd> columns;
    for (const Eigen::MatrixXd& all : signaturesOf(v)) columns.push_back(all.col(static_cast<Eigen::Index>(amplitude)));
    return columns;
  };
  // The middle of the shapes of each effect; falls and swell at a place of their own; a lean by what lateral channels
  // show of it, of its sways the fastest.
  for (const EffectDescription& effect : effectRegistry()) {
    const std::string name = effect.name;
    const Site& site = sites_.front();
    if (name == "block_drop" && site.observation().ice_contact) {
      Eigen::VectorXd column = Eigen::VectorXd::Zero(data_.size());
      const double late = 0.6 * site.observation().time_s[site.rows() - 1];
      column.segment(site.first_row, site.rows()) = fallTemplate(late, site.observation().time_s);
      add(effect, makeFalls({late}).amplitudes[0], {column});
      continue;
    }
    if (name == "vessel_heave" && swell_) {
      add(effect, swell_->amplitudes[0], columnOn(*swell_, 0));
      continue;
    }
    if (name == "pole_tilt" && !leaning_.empty()) {
      for (const Variant& way : leaning_) {
        const Eigen::MatrixXd columns = sidewaysOnly(way);
        for (std::size_t k = 0; k < way.amplitudes.size(); ++k) {
          add(effect, way.amplitudes[k], {columns.col(static_cast<Eigen::Index>(k))});
        }
      }
      continue;
    }
    for (const auto& [v, k] : typicalAmplitudes(effect)) {
      add(effect, v->amplitudes[k], columnOn(*v, k));
    }
  }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (seen[i].effect == seen[j].effect) continue;
      const double r = std::abs(detectability.correlation(seen[i].change, seen[j].change));
      if (r < thresholds_.rival_correlation) continue;
      result.confusable.push_back({{seen[j].effect->name, seen[i].effect->name},
                                   r,
                                   std::string(seen[j].effect->name) + ": " + seen[j].effect->how_to_tell + "; " +
                                       seen[i].effect->name + ": " + seen[i].effect->how_to_tell});
    }
  }
}

/// Baseline, curves, what is left and the overlay.
/// @param best  the explanation that was accepted, or null
void Chain::addCurves(const Model& baseline, const Model* best, Identification& result) const {
  for (std::size_t k = 0; k < ice_.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    result.baseline.push_back({ice_[k].key, ice_[k].unit, ice_[k].prior, ice_[k].sigma, ice_[k].prior + baseline.x[i],
                               std::sqrt(baseline.fit.covariance(i, i))});
  }
  for (std::size_t i = 0; i < records_; ++i) {
    const Eigen::Index own = sites_[i].own();
    const std::string of = records_ > 1 ? " of record " + std::to_string(i + 1) : "";
    const double gap = sites_[i].scenario.procedure.start_gap_m;
    result.baseline.push_back({"procedure.start_gap_m" + of, "m", gap, kGapSigmaM, gap + baseline.x[own],
                               std::sqrt(baseline.fit.covariance(own, own))});
    result.baseline.push_back({"clock of the force" + of, "s", 0.0, sites_[i].observation().clock_sigma_s,
                               baseline.x[own + 1], std::sqrt(baseline.fit.covariance(own + 1, own + 1))});
    RecordCurves c = sites_[i].curves;
    const auto rows = [&](const Eigen::VectorXd& all) {
      return Eigen::VectorXd(all.segment(sites_[i].first_row, sites_[i].rows()));
    };
    const Eigen::MatrixXd covariance =
        (errors_.noise + errors_.discrepancy)
            .block(sites_[i].first_row, sites_[i].first_row, sites_[i].rows(), sites_[i].rows());
    c.baseline_n = sites_[i].mean_n;
    c.refitted_n = rows(baseline.curve_n);
    c.before = computeError(c.observation, c.baseline_n, covariance);
    c.refitted = computeError(c.observation, c.refitted_n, covariance);
    if (best != nullptr) {
      c.with_effect_n = rows(best->curve_n);
      c.after = computeError(c.observation, c.with_effect_n, covariance);
    }
    c.total_sigma_n = covariance.diagonal().cwiseSqrt();
    result.records.push_back(c);
  }
  result.whitened_before = whitened(baseline);
  result.autocorrelation_before = computeAutocorrelation(whitened(baseline), kPortmanteauLags);
  if (best != nullptr) {
    result.autocorrelation_after = computeAutocorrelation(whitened(*best), kPortmanteauLags);
    Scenario twin = scenarioAt(sites_.front(), best->x, best->variants, 1);
    Eigen::Index column = unknowns();
    for (const Variant* v : best->variants) {
      const auto count = static_cast<Eigen::Index>(v->amplitudes.size());
      if (v->effect->reading_only) v->apply(twin.effects[v->effect->name], best->x.segment(column, count));
      column += count;
    }
    result.overlay = toOverlay(twin);
  } else {
    result.overlay = toOverlay(scenarioAt(sites_.front(), baseline.x, {}, 1));
  }
  if (best != nullptr && !result.holdout.empty()) {
    result.holdout.front().with_effect_n = predicted_[*result.accepted].curve_n;
    result.holdout.front().after = predicted_[*result.accepted].error;
  }
}

}  // namespace brash_ice_rig
