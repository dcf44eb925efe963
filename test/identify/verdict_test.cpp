#include "brash_ice_rig/identify/verdict.h"

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// What was found of an effect, or of two, by simulation; the rest as it should be.
Explanation found(const std::vector<std::string>& effects, double log_bayes_factor, double holdout_rmse_n = kNone) {
  Explanation e;
  e.effects = effects;
  e.log_bayes_factor = log_bayes_factor;
  e.threshold = 6.0;
  e.explained_ratio = 0.9;
  e.confirmed = true;
  e.detectability = 8.0;
  e.holdout_rmse_n = holdout_rmse_n;
  e.holdout_ratio = holdout_rmse_n / 1000.0;
  e.holdout_log_ratio = (1000.0 - holdout_rmse_n) / 10.0;
  e.holdout_way_log_ratio = kNone;
  return e;
}

Identification ranked(const std::vector<Explanation>& ranking, double chi2_per_bin = 2.0) {
  Identification result;
  result.ranking = ranking;
  result.chi2_per_bin = chi2_per_bin;
  result.portmanteau_p = 0.5;
  result.discrepancy.way_m = {0.0, 1.0};  // references were given
  return result;
}

using Names = std::vector<std::string>;

Identification decided(Identification result, const RecordReport& report = RecordReport()) {
  decide(result, report, Thresholds());
  return result;
}

TEST(Verdict, AnEffectIsNamedThatExceedsItsThreshold) {
  const Identification result = decided(ranked({found({"drainage"}, 6.1), found({"block_drop"}, 1.0)}));
  EXPECT_EQ(result.verdict, Verdict::kEffect);
  EXPECT_EQ(result.effects, Names{"drainage"});
  EXPECT_EQ(result.accepted, 0u);
  EXPECT_EQ(decided(ranked({found({"drainage"}, 6.0)})).verdict, Verdict::kUnknown);
}

TEST(Verdict, WhatMakesTheCurveFarWorseIsNotNamed) {
  // What an effect's law may be off grows with it, and explains any ripple if it is large enough.
  Explanation wild = found({"drainage"}, 20.0);
  wild.error_ratio = 2.1;
  EXPECT_EQ(decided(ranked({wild})).verdict, Verdict::kUnknown);
  EXPECT_EQ(decided(ranked({found({"block_drop"}, 18.0), wild})).effects, Names{"block_drop"}) << "nor is it a rival";
  wild.error_ratio = 1.9;
  EXPECT_EQ(decided(ranked({wild})).effects, Names{"drainage"});
  wild.holdout_log_ratio = 30.0;
  wild.holdout_ratio = 2.1;
  EXPECT_EQ(decided(ranked({wild})).verdict, Verdict::kUnknown);
}

TEST(Verdict, RecordsWithoutReferencesOfTheirProcedureAreNamed) {
  Identification result = decided(ranked({}, 1.0));
  result.records.resize(1);
  result.holdout.resize(1);
  result.records[0].path = "fit.csv";
  result.holdout[0].path = "holdout.csv";
  result.records[0].procedure_known = true;
  const auto told = [](Identification identification) {
    describe(identification, Thresholds());
    std::string all;
    for (const std::string& sentence : identification.summary) all += sentence + '\n';
    return all;
  };
  EXPECT_EQ(told(result).find("fit.csv: too few references"), std::string::npos);
  EXPECT_NE(told(result).find("holdout.csv: too few references"), std::string::npos);
  result.holdout[0].observation.ice_contact = false;
  EXPECT_EQ(told(result).find("too few references"), std::string::npos) << "there is nothing to learn without ice";
  result.holdout[0].observation.ice_contact = true;
  result.discrepancy.way_m.clear();
  EXPECT_EQ(told(result).find("too few references"), std::string::npos) << "none were given";
}

TEST(Verdict, CorrelationCountsOnlyWhereTheResidualIsNotSmall) {
  const Thresholds t;
  EXPECT_TRUE(isSignificant(1.28, 0.9, t));
  EXPECT_FALSE(isSignificant(1.27, 0.9, t));
  EXPECT_TRUE(isSignificant(1.16, 0.0009, t));
  EXPECT_FALSE(isSignificant(1.16, 0.0011, t));
  EXPECT_FALSE(isSignificant(1.14, 0.0, t));
}

TEST(Verdict, WhatTheRecordHardlyShowsIsNotNamedButTold) {
  Explanation small = found({"load_cell_lag"}, 16.0);
  small.detectability = 4.9;
  Identification result = decided(ranked({small}, 0.7));
  EXPECT_EQ(result.verdict, Verdict::kNone);
  result.records.resize(1);
  describe(result, Thresholds());
  EXPECT_NE(result.summary[1].find("load_cell_lag would explain"), std::string::npos) << result.summary[1];
  small.detectability = 5.0;
  EXPECT_EQ(decided(ranked({small}, 0.7)).verdict, Verdict::kEffect);
}

TEST(Verdict, WhatWasNotSimulatedIsNotNamed) {
  Explanation screened = found({"drainage"}, 20.0);
  screened.confirmed = false;
  EXPECT_EQ(decided(ranked({screened})).verdict, Verdict::kUnknown);
}

TEST(Verdict, WhatPredictsTheHeldOutRecordWorseThanNoEffectIsNotNamed) {
  EXPECT_EQ(decided(ranked({found({"drainage"}, 20.0, 1011.0)})).verdict, Verdict::kUnknown);
  EXPECT_EQ(decided(ranked({found({"drainage"}, 20.0, 1009.0)})).verdict, Verdict::kEffect);
  // What is more probable may have a larger error: that counts newtons where the simulator is off by hundreds.
  Explanation probable = found({"drainage"}, 20.0, 1240.0);
  probable.holdout_log_ratio = 0.1;
  EXPECT_EQ(decided(ranked({probable})).verdict, Verdict::kEffect);
  const Identification next =
      decided(ranked({found({"porosity_gradient"}, 20.0, 1110.0), found({"drainage"}, 18.0, 600.0)}));
  EXPECT_EQ(next.verdict, Verdict::kEffect);
  EXPECT_EQ(next.effects, Names{"drainage"});
  EXPECT_EQ(next.accepted, 1u);
}

TEST(Verdict, AnEffectHasToExplainMuchOfAnExcess) {
  Explanation little = found({"drainage"}, 20.0);
  little.explained_ratio = 0.34;
  EXPECT_EQ(decided(ranked({little})).verdict, Verdict::kUnknown);
  // Where there is no excess, there is none to explain: its evidence is enough.
  EXPECT_EQ(decided(ranked({little}, 1.1)).verdict, Verdict::kEffect);
}

TEST(Verdict, RivalsWithinThreeNatsMakeATie) {
  const Identification tie = decided(ranked({found({"drainage"}, 12.0), found({"freeze_bonds"}, 9.1)}));
  EXPECT_EQ(tie.verdict, Verdict::kTie);
  EXPECT_EQ(tie.effects, (Names{"drainage", "freeze_bonds"}));
  EXPECT_EQ(decided(ranked({found({"drainage"}, 12.0), found({"freeze_bonds"}, 8.9)})).verdict, Verdict::kEffect);
}

TEST(Verdict, OfMuchEvidenceAQuarterTellsNothingApart) {
  const Identification tie = decided(ranked({found({"drainage"}, 36.0), found({"thickness_field"}, 27.1)}));
  EXPECT_EQ(tie.effects, (Names{"drainage", "thickness_field"}));
  EXPECT_EQ(decided(ranked({found({"drainage"}, 36.0), found({"thickness_field"}, 26.9)})).verdict, Verdict::kEffect);
}

TEST(Verdict, WithoutReferencesAllThatHoldAreRivals) {
  const auto untaught = [](double first_rmse_n, double second_rmse_n) {
    Identification result =
        ranked({found({"thickness_field"}, 28.0, first_rmse_n), found({"drainage"}, 8.0, second_rmse_n)});
    EXPECT_EQ(decided(result).effects, Names{"thickness_field"});
    result.discrepancy = Discrepancy();
    return decided(result);
  };
  EXPECT_EQ(untaught(930.0, 900.0).effects, (Names{"thickness_field", "drainage"}));
  EXPECT_EQ(untaught(760.0, 1010.0).effects, Names{"thickness_field"});

  Identification told = untaught(930.0, 900.0);
  told.records.emplace_back();
  told.holdout.emplace_back();
  describe(told, Thresholds());
  EXPECT_EQ(std::count_if(told.summary.begin(), told.summary.end(),
                          [](const std::string& s) { return s.rfind("No reference was given", 0) == 0; }),
            1);
}

TEST(Verdict, TheEvidenceOfBothRecordsDecides) {
  // 20 + 5 against 12 + 60.
  const Explanation larger = found({"drainage"}, 20.0, 950.0), better = found({"crane_speed"}, 12.0, 400.0);
  const Identification result = decided(ranked({larger, better}));
  EXPECT_EQ(result.verdict, Verdict::kEffect);
  EXPECT_EQ(result.effects, Names{"crane_speed"});
  EXPECT_EQ(result.accepted, 1u);
  // 12 + 10 is not clearly more than 20 + 1, nor less.
  EXPECT_EQ(decided(ranked({found({"drainage"}, 20.0, 990.0), found({"crane_speed"}, 12.0, 900.0)})).verdict,
            Verdict::kTie);
  // What has too little evidence from the fitted record is not named, but nothing is named alone beside it.
  EXPECT_EQ(decided(ranked({found({"thickness_field"}, 9.0, 1000.0), found({"vessel_heave"}, 1.0, 880.0)})).effects,
            (Names{"thickness_field", "vessel_heave"}));
}

TEST(Verdict, AnEffectWithAThresholdOfItsOwnCountsByWhatItHasBeyondOthers) {
  Explanation bonds = found({"freeze_bonds"}, 40.0, 800.0);
  bonds.threshold = 25.0;
  Explanation drainage = found({"drainage"}, 30.0, 800.0);
  // 40 + 20 - 19 against 30 + 20.
  const Identification larger = decided(ranked({bonds, drainage}));
  EXPECT_EQ(larger.accepted, 1u);
  EXPECT_DOUBLE_EQ(larger.ranking[0].evidence_of_both, 41.0);
  EXPECT_DOUBLE_EQ(larger.ranking[1].evidence_of_both, 50.0);
  // What lifts have that lack nothing makes no tie: 20 + 20 - 19.
  bonds.log_bayes_factor = 20.0;
  EXPECT_EQ(decided(ranked({drainage, bonds})).verdict, Verdict::kEffect);
  bonds.threshold = 6.0;
  EXPECT_EQ(decided(ranked({drainage, bonds})).verdict, Verdict::kTie);
}

TEST(Verdict, WavesThatKeepTheirLengthAlongTheWayAreUnknown) {
  Explanation swell = found({"vessel_heave"}, 36.0, 890.0);  // 11 of the held-out record
  swell.holdout_way_log_ratio = 16.9;
  EXPECT_EQ(decided(ranked({swell})).verdict, Verdict::kEffect);
  swell.holdout_way_log_ratio = 17.1;
  Identification result = decided(ranked({swell}));
  EXPECT_EQ(result.verdict, Verdict::kUnknown);
  const auto saysWhy = [](Identification& told) {
    told.records.emplace_back();
    told.holdout.emplace_back();
    describe(told, Thresholds());
    return std::count_if(told.summary.begin(), told.summary.end(), [](const std::string& s) {
      return s.find("turns with the hoist, not like the sea") != std::string::npos;
    });
  };
  EXPECT_EQ(saysWhy(result), 1);
  Identification other = decided(ranked({swell, found({"drainage"}, 30.0, 900.0)}));
  EXPECT_EQ(other.effects, Names{"drainage"});
  EXPECT_EQ(saysWhy(other), 1);
  Identification untaught = ranked({swell});
  untaught.discrepancy = Discrepancy();
  EXPECT_EQ(decided(untaught).verdict, Verdict::kEffect);
}

TEST(Verdict, ARivalOfTheSameClassNeedsHalfOfTheEvidence) {
  for (const double evidence : {11.0, 9.0}) {
    Identification result = ranked({found({"drainage"}, 20.0), found({"freeze_bonds"}, evidence)});
    EXPECT_EQ(decided(result).verdict, Verdict::kEffect);
    result.confusable.push_back({{"freeze_bonds", "drainage"}, 0.95, ""});  // on this record
    EXPECT_EQ(decided(result).verdict, evidence > 10.0 ? Verdict::kTie : Verdict::kEffect) << evidence;
  }
  // As porosity_gradient.cpp says of itself.
  Explanation rival = found({"thickness_field"}, 42.0);
  EXPECT_EQ(decided(ranked({found({"porosity_gradient"}, 60.0), rival})).effects,
            (Names{"porosity_gradient", "thickness_field"}));
  EXPECT_EQ(decided(ranked({found({"thickness_field"}, 60.0), found({"porosity_gradient"}, 42.0)})).effects,
            (Names{"thickness_field", "porosity_gradient"}));
  // The held-out record counts as well: 42 + 20 against 60 + 50 and 60 + 70.
  rival = found({"thickness_field"}, 42.0, 800.0);
  EXPECT_EQ(decided(ranked({found({"porosity_gradient"}, 60.0, 500.0), rival})).verdict, Verdict::kTie);
  EXPECT_EQ(decided(ranked({found({"porosity_gradient"}, 60.0, 300.0), rival})).verdict, Verdict::kEffect);
  rival = found({"thickness_field"}, 42.0);
  rival.detectability = 4.9;  // the record does not show it
  EXPECT_EQ(decided(ranked({found({"porosity_gradient"}, 60.0), rival})).verdict, Verdict::kEffect);
}

TEST(Verdict, ARivalThatTheHeldOutRecordSpeaksAgainstIsNone) {
  const Identification result =
      decided(ranked({found({"drainage"}, 12.0, 600.0), found({"porosity_gradient"}, 11.5, 1110.0)}));
  EXPECT_EQ(result.verdict, Verdict::kEffect);
  EXPECT_EQ(result.effects, Names{"drainage"});
}

TEST(Verdict, TellsWhatTheHeldOutRecordRuledOutAndNothingThatHasLessEvidence) {
  Identification result =
      decided(ranked({found({"porosity_gradient"}, 13.0, 1110.0), found({"drainage"}, 12.0, 600.0),
                      found({"freeze_bonds"}, 9.5, 1010.0), found({"load_cell_scale"}, 8.0, 1200.0)}));
  ASSERT_EQ(result.effects, Names{"drainage"});
  result.records.emplace_back();
  result.holdout.emplace_back();
  describe(result, Thresholds());
  const auto told = [&](const std::string& name) {
    return std::count_if(result.summary.begin(), result.summary.end(), [&](const std::string& sentence) {
      return sentence.rfind(name + " would explain this record as well", 0) == 0;
    });
  };
  EXPECT_EQ(told("porosity_gradient"), 1);
  EXPECT_EQ(told("freeze_bonds"), 1);
  EXPECT_EQ(told("load_cell_scale"), 0);
  EXPECT_EQ(told("drainage"), 0);
}

TEST(Verdict, APairMustNotPredictTheHeldOutRecordWorseThanEitherAlone) {
  const std::vector<Explanation> ranking = {found({"drainage", "vessel_heave"}, 30.0, 500.0),
                                            found({"drainage"}, 20.0, 600.0)};
  EXPECT_EQ(decided(ranked(ranking)).effects, (Names{"drainage", "vessel_heave"}));
  EXPECT_EQ(decided(ranked({found({"drainage", "vessel_heave"}, 30.0, 611.0), ranking[1]})).effects, Names{"drainage"});
}

TEST(Verdict, WithoutAnEffectTheResidualDecides) {
  Identification result = ranked({found({"drainage"}, 2.0)}, 1.26);
  EXPECT_EQ(decided(result).verdict, Verdict::kNone);
  EXPECT_FALSE(decided(result).significant);
  result.portmanteau_p = 1e-4;  // what is left is not only noise, though it is small
  EXPECT_EQ(decided(result).verdict, Verdict::kUnknown);
  result.chi2_per_bin = 1.1;
  EXPECT_EQ(decided(result).verdict, Verdict::kNone);
  EXPECT_EQ(decided(ranked({found({"drainage"}, 2.0)}, 1.28)).verdict, Verdict::kUnknown);
}

TEST(Verdict, WhatTheHeldOutRecordSpeaksAgainstIsNoProofThatNothingIsMissing) {
  EXPECT_EQ(decided(ranked({found({"drainage"}, 20.0, 1010.0)}, 0.9)).verdict, Verdict::kUnknown);
  Explanation small = found({"drainage"}, 20.0, 1010.0);
  small.detectability = 4.9;
  EXPECT_EQ(decided(ranked({small}, 0.9)).verdict, Verdict::kNone);
}

TEST(Verdict, NothingFoundInPartOfALiftProvesNothing) {
  RecordReport part;
  part.findings.emplace_back();
  part.findings.back().code = "too_short";
  EXPECT_EQ(decided(ranked({}, 1.0), part).verdict, Verdict::kCannotTell);
  EXPECT_EQ(decided(ranked({}, 2.0), part).verdict, Verdict::kUnknown);
  EXPECT_EQ(decided(ranked({found({"load_cell_bias"}, 20.0)}, 1.0), part).verdict, Verdict::kEffect);
}

}  // namespace
}  // namespace brash_ice_rig
