#include "brash_ice_rig/identify/identification.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "brash_ice_rig/identify/chain.h"
#include "brash_ice_rig/identify/verdict.h"

namespace brash_ice_rig {
namespace {

/// Explanations that are confirmed by simulation in any case, and the passes of Gauss-Newton for each.
constexpr std::size_t kConfirmed = 4;
/// ln of the Bayes factor below which a straight line's verdict is final: a simulation would not make up for 5.
constexpr double kWorthSimulating = 1.0;
constexpr int kPasses = 2;
/// Where references say how far the simulator is off, nothing is known better than this share of the largest force.
constexpr double kReferenceFloor = 0.005;

bool isHopeless(const Model& model, const Model& baseline) {
  return score(model) - baseline.fit.log_evidence <= kWorthSimulating;
}

/// Whether an explanation is worth simulating. Of several with enough evidence, none may win for want of the others'
/// simulation.
/// @param models  the likeliest first
bool mustBeConfirmed(const std::vector<Model>& models, std::size_t k, const Model& baseline,
                     const Thresholds& thresholds) {
  if (k < kConfirmed) return !isHopeless(models[k], baseline);
  return score(models[k]) - baseline.fit.log_evidence > thresholds.of(models[k].variants[0]->effect->name);
}

}  // namespace

Identification Chain::run() {
  Identification result;
  for (const NamedRecord& record : input_.records) {
    sites_.push_back(makeSite(record));
    sites_.back().record = records_++;
  }
  result.discrepancy = *sites_.front().discrepancy;
  addLateralSites();
  ice_ = iceUnknowns(sites_.front().curves.record);
  simulateBaseline();
  {
    std::vector<const Variant*> all;
    for (const auto& v : variants_) all.push_back(v.get());
    if (swell_) all.push_back(swell_.get());
    computeSignatures(all, "what effects do");
  }
  // Slopes are rough: the baseline is simulated where they lead before anything else is fitted around it.
  Model baseline = linear(nullptr);
  confirm({&baseline}, "baseline refitted");
  if (baseline.frozen) throw ConfigError("", "", "the simulation of the refitted ice freezes", input_.records[0].path);
  baseline_offset_ = baseline.offset;
  setErrors(baseline.curve_n, baseline.x);
  refit(baseline);
  locate(baseline, "tilt, falls, and swell");

  std::vector<Model> models = screenEffects(baseline);
  std::vector<Model*> to_confirm{&baseline};
  for (std::size_t k = 0; k < models.size(); ++k) {
    if (mustBeConfirmed(models, k, baseline, thresholds_)) to_confirm.push_back(&models[k]);
  }
  for (int pass = 0; pass < kPasses && !input_.screen_only; ++pass) {
    to_confirm.erase(std::remove_if(to_confirm.begin(), to_confirm.end(),
                                    [&](const Model* m) { return m != &baseline && isHopeless(*m, baseline); }),
                     to_confirm.end());
    if (to_confirm.size() == 1) break;
    confirm(to_confirm, "full simulations of the best explanations");
  }
  // A simulation counts for more than a straight line.
  std::stable_sort(models.begin(), models.end(), [](const Model& a, const Model& b) {
    return a.simulated != b.simulated ? a.simulated : score(a) > score(b);
  });
  if (!models.empty() && models.front().simulated && !isHopeless(models.front(), baseline)) {
    startAsStated(models.front(), baseline);
    startAgain(baseline, models.front());
  }
  addSecondEffect(models, baseline);

  const Detectability detectability(linearModel(baseline), errors_, baseline.fit.kappa);
  for (const Model& model : models) result.ranking.push_back(explain(model, baseline, detectability));
  addDetectable(result, detectability);
  if (input_.holdout && !input_.screen_only) evaluateHoldout(baseline, models, result);
  result.bins = static_cast<std::size_t>(record_rows_);
  result.chi2_per_bin = chi2PerBin(baseline);
  result.portmanteau_p = computeLjungBox(whitened(baseline), kPortmanteauLags);
  result.kappa = baseline.fit.kappa;
  result.ice_factor = iceFactor(sites_.front());
  decide(result, sites_.front().curves.report, thresholds_);

  addCurves(baseline, result.accepted ? &models[*result.accepted] : nullptr, result);
  describe(result, thresholds_);
  return result;
}

/// Where much is missing, the refitted ice is bent to make up for it, and two passes from there need not lead back: the
/// best explanation is simulated where the ice as stated leads, too.
void Chain::startAsStated(Model& best, const Model& baseline) {
  if (chi2PerBin(baseline) <= thresholds_.chi2_per_bin) return;
  Model again = best;
  again.offset = baselineAsStated();
  refit(again);
  confirm({&again}, "the best explanation from the ice as stated");
  if (!again.frozen && again.fit.log_evidence > best.fit.log_evidence) best = again;
}

/// Lets the baseline start once more from the ice of the best explanation: what that owes to a better fit of
/// the ice must not count for its effect.
void Chain::startAgain(Model& baseline, const Model& best) {
  Model again = baseline;
  again.fit.x = best.fit.x.head(unknowns());
  // All passes before it may count: after the first one it is simulated at the ice of another model.
  for (int pass = 0; pass < kPasses; ++pass) confirm({&again}, "baseline from the ice of the best explanation");
  if (!again.frozen && again.fit.log_evidence > baseline.fit.log_evidence) baseline = again;
}

/// Each effect in its best shape, the likeliest first. Those that will be confirmed are taken on all pairs before.
std::vector<Model> Chain::screenEffects(const Model& baseline) {
  std::map<const Variant*, Model> screened;
  const auto screen = [&](const Variant& v) {
    Model& model = screened[&v] = linear(&v);
    if (!v.effect->reading_only) return;
    model.x = Eigen::VectorXd::Zero(model.fit.x.size());
    model.x.head(unknowns()) = baseline.x;
    fitReading(model);
  };
  for (const auto& v : variants_) screen(*v);
  for (;;) {
    std::vector<Model> models = bestShapes(screened, baseline);
    std::vector<const Variant*> best;
    for (std::size_t k = 0; k < models.size(); ++k) {
      if (mustBeConfirmed(models, k, baseline, thresholds_)) best.push_back(models[k].variants[0]);
    }
    if (!settle(best)) return models;
    for (const Variant* v : best) screen(*v);
  }
}

/// Each effect in its best shape, the likeliest first; what the other shapes say of it counts as well.
std::vector<Model> Chain::bestShapes(const std::map<const Variant*, Model>& screened, const Model& baseline) const {
  std::vector<Model> models;
  for (const EffectDescription& effect : effectRegistry()) {
    std::vector<double> evidence;
    std::vector<Model> shapes;
    for (const auto& v : variants_) {
      if (v->effect != &effect) continue;
      shapes.push_back(screened.at(v.get()));
      evidence.push_back(shapes.back().fit.log_evidence);
    }
    if (shapes.empty()) continue;
    const auto best = shapes.begin() + (std::max_element(evidence.begin(), evidence.end()) - evidence.begin());
    for (auto other = shapes.begin(); other != shapes.end(); ++other) {
      const bool same_unknown = other->variants[0]->amplitudes[0].name == best->variants[0]->amplitudes[0].name;
      if (other != best && same_unknown && !other->density.value.empty()) best->other_shapes.push_back(other->density);
    }
    best->shape_log_odds += logMeanExp(evidence) - best->fit.log_evidence;
    best->screened = score(*best) - baseline.fit.log_evidence;
    best->screened_fit = best->fit;
    models.push_back(*best);
  }
  const auto byScore = [](const Model& a, const Model& b) { return score(a) > score(b); };
  std::stable_sort(models.begin(), models.end(), byScore);
  return models;
}

/// Tries what is left beside the best explanation, and keeps a pair that is so much better that chance is no excuse.
void Chain::addSecondEffect(std::vector<Model>& models, const Model& baseline) {
  if (models.empty()) return;
  const Model first = models.front();
  const std::string first_name = first.variants[0]->effect->name;
  const double gained = score(first) - baseline.fit.log_evidence;
  if (!first.simulated || gained < thresholds_.of(first_name)) return;
  // What the first one leaves must mean something, or the second would explain the simulator's own error.
  if (!isSignificant(chi2PerBin(first), computeLjungBox(whitened(first), kPortmanteauLags), thresholds_)) return;
  locate(first, "tilt, falls, and swell beside " + first_name);
  const auto with = [&](const Variant& second) {
    Model pair = first;
    addEffect(pair, second, signatures_.at(&second));
    refit(pair);
    return pair;
  };
  std::optional<Model> best;
  for (const auto& v : variants_) {
    if (v->effect->name == first_name || signatures_.count(v.get()) == 0) continue;
    const Model pair = with(*v);
    if (!best || score(pair) > score(*best)) best = pair;
  }
  if (!best || score(*best) - score(first) <
                   std::max(thresholds_.second_effect, thresholds_.of(best->variants[1]->effect->name)))
    return;
  const Variant* const second = best->variants[1];
  if (settle({second})) best = with(*second);
  for (int pass = 0; pass < kPasses; ++pass) confirm({&*best}, "two effects");
  if (best->simulated && score(*best) - score(first) > thresholds_.second_effect) models.insert(models.begin(), *best);
}

std::optional<ReferenceLift> Chain::reference(bool simulate) {
  baseline_only_ = true;
  sites_.push_back(makeSite(input_.records.front()));
  records_ = 1;
  ice_ = iceUnknowns(sites_.front().curves.record);
  simulateBaseline();
  const Site& site = sites_.front();
  if (!site.observation().ice_contact) return {};
  Model baseline = linear(nullptr);
  if (simulate) {
    confirm({&baseline}, "reference " + site.curves.path);
    setErrors(baseline.simulated ? baseline.curve_n : baseline.fit.mean, clipped(baseline, baseline.fit.x));
    refit(baseline);
  }
  ReferenceLift lift;
  const Eigen::VectorXd simulated_n = site.uncorrected(baseline.fit.mean), left = data_ - simulated_n;
  const double level = computeLevel(simulated_n);
  const Eigen::Index at_rest = (site.observation().time_s.array() <= 0.0).count();
  if (at_rest > 0) lift.rest_share = left.head(at_rest).mean() / level;
  lift.path = site.observation().path;
  for (Eigen::Index i = at_rest; i < site.rows(); ++i) {
    lift.time_s.push_back(site.observation().time_s[i]);
    lift.way_m.push_back(site.observation().way_m[i]);
    lift.residual_share.push_back(left[i] / level);
  }
  const Eigen::VectorXd x = clipped(baseline, baseline.fit.x);
  for (Eigen::Index k = 0; k < kIceUnknowns; ++k) lift.ice[k] = ice_[static_cast<std::size_t>(k)].prior + x[k];
  return lift;
}

std::vector<std::vector<NamedRecord>> groupReferences(const IdentifyInput& input) {
  std::vector<std::vector<HoistStage>> procedures;
  for (const NamedRecord& reference : input.references) {
    procedures.push_back(stagesOf(readCurves(reference).observation.path));
  }
  std::vector<NamedRecord> records = input.records;
  if (input.holdout) records.push_back(*input.holdout);
  std::vector<std::vector<HoistStage>> met;
  std::vector<std::vector<NamedRecord>> groups;
  bool all = false;
  for (const NamedRecord& record : records) {
    const Observation observation = readCurves(record).observation;
    const std::vector<HoistStage> own = stagesOf(observation.path);
    const auto isOwn = [&](const std::vector<HoistStage>& other) { return isSameProcedure(own, other); };
    if (!observation.ice_contact || std::any_of(met.begin(), met.end(), isOwn)) continue;
    met.push_back(own);
    std::vector<NamedRecord> group;
    for (std::size_t i = 0; i < procedures.size(); ++i) {
      if (isOwn(procedures[i])) group.push_back(input.references[i]);
    }
    const bool enough = group.size() >= kEnoughReferences && group.size() < procedures.size();
    if (enough) groups.push_back(group);
    all = all || !enough;
  }
  if (all || groups.empty()) groups.push_back(input.references);
  return groups;
}

namespace {

bool isSameRecord(const Record& a, const Record& b) {
  const auto same = [](double x, double y) { return x == y || (std::isnan(x) && std::isnan(y)); };
  return std::equal(a.time_s.begin(), a.time_s.end(), b.time_s.begin(), b.time_s.end(), same) &&
         std::equal(a.force_n.begin(), a.force_n.end(), b.force_n.begin(), b.force_n.end(), same);
}

/// A record that is given twice is evidence but once: as its own reference it would teach that nothing is missing, as
/// its own held-out record it would confirm whatever was fitted, and references that agree to the last digit would
/// leave nothing to allow for.
/// @throws ConfigError
void refuseRepeats(const IdentifyInput& input) {
  std::vector<std::pair<const NamedRecord*, const char*>> all;
  for (const NamedRecord& record : input.records) all.emplace_back(&record, "a record to be fitted");
  if (input.holdout) all.emplace_back(&*input.holdout, "the held-out record");
  for (const NamedRecord& record : input.references) all.emplace_back(&record, "a reference");
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      if (!isSameRecord(all[i].first->record, all[k].first->record)) continue;
      throw ConfigError("", "",
                        std::string("is ") + all[i].second + ", but its samples are those of " + all[k].first->path +
                            ", " + all[k].second + ": each record must be given once",
                        all[i].first->path);
    }
  }
}

/// What is left of references depends on how much the fit allows for. It starts with little, so that the ice has to
/// explain what it can, and settles within a few passes; in the last, the refitted ice is simulated, as it will be for
/// the record.
Discrepancy learnFrom(const std::vector<NamedRecord>& references, RunLibrary& runs, const Thresholds& thresholds,
                      const Discrepancy& before) {
  constexpr int kLearningPasses = 3;
  constexpr double kLittle = 0.03;
  Discrepancy learned = before;
  learned.share = kLittle;
  learned.share_of_peak = 0.0;
  for (int pass = 0; pass < kLearningPasses; ++pass) {
    std::vector<ReferenceLift> lifts;
    for (const NamedRecord& record : references) {
      IdentifyInput reference;
      reference.records.push_back(record);
      const bool last = pass + 1 == kLearningPasses;
      if (auto lift = Chain(reference, runs, thresholds, {learned}).reference(last)) lifts.push_back(*lift);
    }
    if (lifts.empty()) throw ConfigError("", "", "no reference shows ice", references.front().path);
    learned = learnDiscrepancy(lifts, learned);
  }
  learned.share = before.share;
  learned.share_of_peak = kReferenceFloor;
  return learned;
}

}  // namespace

Identification identify(const IdentifyInput& input, RunLibrary& runs, const Thresholds& thresholds,
                        const Discrepancy& discrepancy) {
  const auto start = std::chrono::steady_clock::now();
  refuseRepeats(input);
  std::vector<Discrepancy> discrepancies;
  if (!input.references.empty()) {
    for (const std::vector<NamedRecord>& group : groupReferences(input)) {
      discrepancies.push_back(learnFrom(group, runs, thresholds, discrepancy));
    }
  } else {
    discrepancies.push_back(discrepancy);
  }
  Identification result = Chain(input, runs, thresholds, discrepancies).run();
  result.runs_needed = runs.requested();
  result.runs_made = runs.made();
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace brash_ice_rig
