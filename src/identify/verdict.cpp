#include "brash_ice_rig/identify/verdict.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "brash_ice_rig/effects/effect_registry.h"

namespace brash_ice_rig {
namespace {

std::string shortNumber(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

std::string joined(const std::vector<std::string>& names, const char* last) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    text += i == 0 ? "" : i + 1 == names.size() ? std::string(" ") + last + " " : ", ";
    text += names[i];
  }
  return text;
}

/// Whether a record shows this effect, whatever else may speak against it.
bool stands(const Explanation& e, const Thresholds& thresholds) {
  return e.confirmed && e.log_bayes_factor > e.threshold && e.detectability >= thresholds.detectability;
}

/// Whether what looks like swell goes with the hoist's way and not with the time. Never where that was not asked, nor
/// without references: then what lifts differ by passes for evidence.
bool goesWithTheWay(const Explanation& e, const Identification& result, const Thresholds& thresholds) {
  return result.discrepancy.fromReferences() &&
         e.holdout_way_log_ratio - e.holdout_log_ratio > thresholds.log_bayes_factor;
}

/// Never without a held-out record.
bool heldOutSpeaksAgainst(const Explanation& e, const Identification& result, const Thresholds& thresholds) {
  return e.holdout_log_ratio <= thresholds.holdout_log_ratio || goesWithTheWay(e, result, thresholds);
}

/// Whether an effect makes the curve of a record far worse. What its law may be off grows with it, and enough of that
/// makes anything probable, a ripple say, that the effect itself says nothing of.
bool missesTheCurve(const Explanation& e, const Thresholds& thresholds) {
  return e.error_ratio > thresholds.error_ratio || e.holdout_ratio > thresholds.error_ratio;
}

/// Whether two effects do much the same to the force: on this record, or as is known of them.
bool areOfOneClass(const std::string& a, const std::string& b, const std::vector<ConfusableSet>& confusable) {
  const auto declares = [](const std::string& one, const std::string& other) {
    const EffectDescription* effect = findEffect(one);
    return effect != nullptr && std::count(effect->confusable_with.begin(), effect->confusable_with.end(), other) > 0;
  };
  return declares(a, b) || declares(b, a) ||
         std::any_of(confusable.begin(), confusable.end(), [&](const ConfusableSet& set) {
           return std::count(set.effects.begin(), set.effects.end(), a) > 0 &&
                  std::count(set.effects.begin(), set.effects.end(), b) > 0;
         });
}

/// Explanation::evidence_of_both.
double evidenceOfBoth(const Explanation& e, const Thresholds& thresholds) {
  const double of_held_out = std::isfinite(e.holdout_log_ratio) ? e.holdout_log_ratio : 0.0;
  return e.log_bayes_factor + of_held_out - std::max(e.threshold - thresholds.log_bayes_factor, 0.0);
}

/// Whether evidence is not clearly less than the most there is.
bool isAsMuch(double evidence, double most, const Thresholds& thresholds) {
  return most - evidence < std::max(thresholds.rival_nats, thresholds.rival_share * most);
}

/// Whether this effect cannot be told from the other one, of which there is evidence.
bool isRival(const Explanation& e, const Explanation& other, const std::vector<ConfusableSet>& confusable,
             const Thresholds& thresholds) {
  const double evidence = e.evidence_of_both, most = other.evidence_of_both;
  return isAsMuch(evidence, most, thresholds) ||
         (stands(e, thresholds) && evidence > 0.5 * most && areOfOneClass(e.effects[0], other.effects[0], confusable));
}

/// Of what goes with the way.
std::string describeTheWay(const Explanation& e) {
  return "The held-out record, which goes at another speed, is more probable if its waves keep their length along the "
         "hoist's way (ln of the odds " +
         shortNumber(e.holdout_way_log_ratio) +
         ") than if they keep their period: this looks like something that turns with the hoist, not like the sea.";
}

}  // namespace

const char* verdictName(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNone:
      return "none";
    case Verdict::kEffect:
      return "effect";
    case Verdict::kTie:
      return "tie";
    case Verdict::kUnknown:
      return "unknown";
    case Verdict::kCannotTell:
      return "cannot_tell";
  }
  return "unknown";
}

bool isSignificant(double chi2_per_bin, double portmanteau_p, const Thresholds& thresholds) {
  // Residuals that are smaller than what is allowed for may be correlated: the allowance is not known that finely.
  return chi2_per_bin > thresholds.chi2_per_bin ||
         (chi2_per_bin > thresholds.portmanteau_chi2_per_bin && portmanteau_p < thresholds.portmanteau_p);
}

void decide(Identification& result, const RecordReport& report, const Thresholds& thresholds) {
  const bool excess = result.chi2_per_bin > thresholds.chi2_per_bin;
  result.significant = isSignificant(result.chi2_per_bin, result.portmanteau_p, thresholds);
  for (Explanation& e : result.ranking) e.evidence_of_both = evidenceOfBoth(e, thresholds);

  bool partial = false;
  for (const Finding& finding : report.findings) {
    partial = partial || finding.code == "too_short" || finding.code == "no_contact";
  }

  // A second effect must not make the held-out record less probable than either alone.
  const auto earnsItsPlace = [&](const Explanation& pair) {
    for (const Explanation& e : result.ranking) {
      const bool part = e.effects.size() == 1 && e.confirmed &&
                        std::count(pair.effects.begin(), pair.effects.end(), e.effects[0]) > 0;
      if (part && pair.holdout_log_ratio - e.holdout_log_ratio <= thresholds.holdout_log_ratio) return false;
    }
    return true;
  };
  const auto holds = [&](const Explanation& e) {
    if (e.effects.size() > 1 && !earnsItsPlace(e)) return false;
    return stands(e, thresholds) && !heldOutSpeaksAgainst(e, result, thresholds) && !missesTheCurve(e, thresholds) &&
           (!excess || e.explained_ratio >= thresholds.explained_ratio);
  };
  // Without references, evidence also measures how well an effect looks like what the simulator is off for every lift.
  const bool untaught = !result.discrepancy.fromReferences();
  std::vector<const Explanation*> accepted;
  for (const Explanation& e : result.ranking) {
    if (holds(e)) accepted.push_back(&e);
  }
  if (!accepted.empty()) {
    const Explanation* best = *std::max_element(
        accepted.begin(), accepted.end(),
        [](const Explanation* a, const Explanation* b) { return a->evidence_of_both < b->evidence_of_both; });
    std::vector<const Explanation*> contenders{best};
    if (best->effects.size() == 1) {
      for (const Explanation& e : result.ranking) {
        if (e.effects == best->effects || e.effects.size() != 1 || e.log_bayes_factor <= 0.0) continue;
        if (heldOutSpeaksAgainst(e, result, thresholds) || missesTheCurve(e, thresholds)) continue;
        if ((untaught && holds(e)) || isRival(e, *best, result.confusable, thresholds)) {
          contenders.push_back(&e);
        }
      }
    }
    result.accepted = static_cast<std::size_t>(best - result.ranking.data());
    result.effects = best->effects;
    result.verdict = contenders.size() > 1 ? Verdict::kTie : Verdict::kEffect;
    for (const Explanation* e : contenders) {
      if (e != best) result.effects.push_back(e->effects.front());
    }
  } else {
    // Where an effect would explain this record but not the held-out one, something is missing all the same.
    const bool missing = result.significant || std::any_of(result.ranking.begin(), result.ranking.end(),
                                                           [&](const Explanation& e) { return stands(e, thresholds); });
    result.verdict = missing ? Verdict::kUnknown : partial ? Verdict::kCannotTell : Verdict::kNone;
  }
}

void describe(Identification& result, const Thresholds& thresholds) {
  const CurveError &refitted = result.records.front().refitted, &after = result.records.front().after;
  std::vector<std::string>& text = result.summary;
  switch (result.verdict) {
    case Verdict::kEffect:
      text.push_back("The model lacks " + joined(result.effects, "and") + ".");
      break;
    case Verdict::kTie:
      text.push_back("The model lacks one of these: " + joined(result.effects, "or") +
                     ". This record cannot tell them apart.");
      break;
    case Verdict::kUnknown:
      text.push_back("The model lacks something that none of the effects known here explains well enough to be named.");
      for (const Explanation& e : result.ranking) {
        if (!e.confirmed || e.log_bayes_factor <= thresholds.rival_nats) break;
        std::string nearest = "Nearest comes " + joined(e.effects, "and") + ": ln of the Bayes factor " +
                              shortNumber(e.log_bayes_factor) + " (asked: more than " + shortNumber(e.threshold) + ")";
        if (std::isfinite(e.holdout_log_ratio)) {
          nearest += ", of the held-out record " + shortNumber(e.holdout_log_ratio) + " (asked: more than " +
                     shortNumber(thresholds.holdout_log_ratio) + ")";
        }
        text.push_back(nearest + ".");
        if (goesWithTheWay(e, result, thresholds)) text.push_back(describeTheWay(e));
        if (missesTheCurve(e, thresholds)) {
          text.push_back("With " + joined(e.effects, "and") + " the error is " + shortNumber(e.error_ratio) +
                         " times that without on this record" +
                         (std::isfinite(e.holdout_ratio)
                              ? ", " + shortNumber(e.holdout_ratio) + " times on the held-out one"
                              : "") +
                         ": it is not the curve that it explains.");
        }
      }
      break;
    case Verdict::kNone:
      text.push_back(
          "Nothing is missing that this record could show: what is left is within noise and the model's own error.");
      break;
    case Verdict::kCannotTell:
      text.push_back("This record cannot tell: it holds too little of a lift.");
      break;
  }
  for (const std::string& name : result.effects) {
    if (const EffectDescription* effect = findEffect(name)) text.push_back(name + ": " + effect->mechanism + ".");
  }
  if (result.accepted) {
    const Explanation& e = result.ranking[*result.accepted];
    std::string evidence = "Evidence: ln of the Bayes factor " + shortNumber(e.log_bayes_factor) +
                           " (asked: more than " + shortNumber(e.threshold) + "), detectability " +
                           shortNumber(e.detectability);
    if (std::isfinite(e.explained_ratio)) {
      evidence += ", " + shortNumber(100.0 * e.explained_ratio) + " % of the excess explained";
    }
    text.push_back(evidence + ".");
    text.push_back("Error of the vertical force on this record: " + shortNumber(refitted.rmse_n) +
                   " N with the baseline refitted, " + shortNumber(after.rmse_n) + " N with the effect.");
    if (std::isfinite(e.holdout_ratio)) {
      text.push_back("Held-out record: ln of its odds with the effect " + shortNumber(e.holdout_log_ratio) +
                     ", error " + shortNumber(result.holdout.front().refitted.rmse_n) + " N without the effect, " +
                     shortNumber(e.holdout_rmse_n) + " N with it.");
    }
    if (e.chi2_per_bin > thresholds.chi2_per_bin) {
      text.push_back("What it leaves still means something (chi² of " + shortNumber(e.chi2_per_bin) +
                     " per bin): its law differs from this one, or there is more that is missing.");
    }
    if (!result.discrepancy.fromReferences()) {
      text.push_back(
          "No reference was given: what the simulator is off for every lift can pass for an effect. Lifts that lack "
          "nothing (--reference) would tell.");
    }
    for (const Explanation& other : result.ranking) {
      if (!other.confirmed || other.log_bayes_factor <= other.threshold) continue;
      if (!heldOutSpeaksAgainst(other, result, thresholds)) continue;
      if (!isAsMuch(other.log_bayes_factor, e.log_bayes_factor, thresholds)) continue;
      std::string but = joined(other.effects, "and") + " would explain this record as well (ln of the Bayes factor " +
                        shortNumber(other.log_bayes_factor) + "), but ";
      if (goesWithTheWay(other, result, thresholds)) {
        text.push_back(but + "it is no swell. " + describeTheWay(other));
        continue;
      }
      text.push_back(but + "the held-out one is less probable with it than without (ln of the odds " +
                     shortNumber(other.holdout_log_ratio) + ").");
    }
  } else {
    for (const Explanation& e : result.ranking) {
      if (!e.confirmed || e.log_bayes_factor <= e.threshold || e.detectability >= thresholds.detectability) continue;
      text.push_back(joined(e.effects, "and") + " would explain a part of it (ln of the Bayes factor " +
                     shortNumber(e.log_bayes_factor) +
                     "), but what this record shows of it is too small to be told: " + "detectability " +
                     shortNumber(e.detectability) + " (asked: " + shortNumber(thresholds.detectability) + ").");
    }
    text.push_back("Residual: chi² of " + shortNumber(result.chi2_per_bin) + " per bin (significant above " +
                   shortNumber(thresholds.chi2_per_bin) + "), portmanteau p = " + shortNumber(result.portmanteau_p) +
                   ".");
  }
  constexpr double kUnlikeReferences = 1.5;
  if (result.ice_factor > kUnlikeReferences) {
    text.push_back("The fitted ice is unlike that of the references. What the model is off there is known less well: " +
                   shortNumber(result.ice_factor) + " times the variance is allowed for.");
  }
  for (const auto* records : {&result.records, &result.holdout}) {
    for (const RecordCurves& r : *records) {
      if (!result.discrepancy.fromReferences() || r.procedure_known || !r.observation.ice_contact) continue;
      text.push_back(r.path +
                     ": too few references start, stop and turn where this record does (six are asked for, "
                     "within 4 cm). What the model is off there is taken from the way alone; lifts of the same "
                     "procedure that lack nothing would tell.");
    }
  }
  const auto propose = [&](const std::string& name, std::vector<std::string> separates) {
    const EffectDescription* effect = findEffect(name);
    if (effect == nullptr || std::string(effect->how_to_tell).empty()) return;
    for (const NextExperiment& known : result.next_experiment) {
      if (known.text == effect->how_to_tell) return;
    }
    result.next_experiment.push_back({effect->how_to_tell, std::move(separates)});
  };
  for (const std::string& name : result.effects)
    propose(name, result.effects.size() > 1 ? result.effects : std::vector<std::string>{name});
  if (result.verdict == Verdict::kUnknown) {
    result.next_experiment.push_back(
        {"the same lift again, at once and in another spot: what comes back at the same height is the rig's, at the "
         "same time the ship's",
         {}});
    result.next_experiment.push_back({"a lift with two stops of 6 s, and one without ice", {}});
  }
  if (result.verdict == Verdict::kNone || result.verdict == Verdict::kCannotTell) {
    for (const DetectableMagnitude& m : result.minimum_detectable) {
      if (m.expected_detectability < thresholds.detectability) propose(m.effect, {m.effect});
    }
  }
}

}  // namespace brash_ice_rig
