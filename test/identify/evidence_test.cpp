#include "brash_ice_rig/identify/evidence.h"

#include <cmath>

#include <gtest/gtest.h>

#include "brash_ice_rig/identify/chain.h"
#include "brash_ice_rig/identify/covariance.h"
#include "made_record.h"

namespace brash_ice_rig {
namespace {

// Reference figures were computed with numpy 1.24 and scipy 1.10 from the textbook formulas in dense matrices.

LinearModel smallModel() {
  LinearModel m;
  m.offset = Eigen::Vector4d(0.5, 0.0, 1.0, 0.0);
  m.columns.resize(4, 2);
  m.columns << 1.0, 0.5, 0.0, 1.0, 2.0, -1.0, 1.0, 0.0;
  m.prior_mean = Eigen::Vector2d(0.3, 0.0);
  m.prior_sigma = Eigen::Vector2d(0.8, 1.5);
  m.positive = {false, false};
  return m;
}

ErrorModel smallErrors() {
  ErrorModel e;
  e.noise = Eigen::Vector4d(0.2, 0.3, 0.4, 0.5).asDiagonal();
  e.discrepancy = Eigen::MatrixXd::Zero(4, 4);
  return e;
}

const Eigen::Vector4d kData(1.2, -0.4, 2.5, 0.9);

TEST(LinearFit, EvidenceAndPosteriorAreThoseOfTheDenseGaussian) {
  const LinearFit fit = fitLinear(kData, smallModel(), smallErrors());
  EXPECT_NEAR(fit.log_evidence, -4.369523289990887, 1e-9);
  EXPECT_NEAR(fit.x[0], 0.68585457, 1e-7);
  EXPECT_NEAR(fit.x[1], -0.21502985, 1e-7);
  EXPECT_NEAR(fit.covariance(0, 0), 0.05639445, 1e-7);
  EXPECT_NEAR(fit.covariance(0, 1), 0.01872878, 1e-7);
  EXPECT_NEAR(fit.kappa, 1.0, 2e-3);  // nothing depends on it
}

TEST(LinearFit, APositiveUnknownStaysAtZeroAndCostsEvidence) {
  LinearModel m = smallModel();
  m.positive[1] = true;
  const LinearFit fit = fitLinear(kData, m, smallErrors());
  EXPECT_EQ(fit.x[1], 0.0);
  // Twice the probability that it is positive: 2 Phi(-0.21502985 / sqrt(0.13906122)).
  const double share = std::erfc(0.21502985 / std::sqrt(0.13906122) / std::sqrt(2.0));
  EXPECT_NEAR(fit.log_evidence, -4.369523289990887 + std::log(share), 1e-6);
}

TEST(LinearFit, APositiveUnknownOfWhichTheDataWantALargeNegativeAmountExplainsNothing) {
  // ln of the integral over x > 0 of 2 N(x; 0, 1) N(-100; x, 1), by quadrature with 40 digits. Of the probability that
  // x is positive, exp(-2505), a double holds nothing.
  LinearModel m;
  m.offset = m.prior_mean = Eigen::VectorXd::Zero(1);
  m.columns = Eigen::MatrixXd::Ones(1, 1);
  m.prior_sigma = Eigen::VectorXd::Ones(1);
  m.positive = {true};
  ErrorModel e;
  e.noise = Eigen::MatrixXd::Ones(1, 1);
  e.discrepancy = Eigen::MatrixXd::Zero(1, 1);
  const LinearFit fit = fitLinear(Eigen::VectorXd::Constant(1, -100.0), m, e);
  EXPECT_NEAR(fit.log_evidence, -5005.7501, 1e-4);
  EXPECT_EQ(fit.x[0], 0.0);
}

TEST(LinearFit, KappaGrowsWithWhatTheDiscrepancyHasToExplain) {
  LinearModel m = smallModel();
  m.columns.resize(4, 0);
  m.prior_mean.resize(0);
  m.prior_sigma.resize(0);
  m.positive.clear();
  ErrorModel e = smallErrors();
  e.discrepancy = Eigen::MatrixXd::Identity(4, 4);
  const LinearFit calm = fitLinear(m.offset, m, e);
  const LinearFit wild = fitLinear(m.offset + Eigen::VectorXd::Constant(4, 5.0), m, e);
  EXPECT_LT(calm.kappa, 1.0);
  EXPECT_GT(wild.kappa, 1.3);
  EXPECT_GT(wild.chi2_per_datum, calm.chi2_per_datum);
}

LinearModel curve(const Eigen::VectorXd& mean) {
  LinearModel m;
  m.offset = mean;
  m.columns.resize(mean.size(), 0);
  return m;
}

TEST(LogDensity, IsThatOfAMixtureOfGaussians) {
  ErrorModel e;
  e.noise.resize(2, 2);
  e.noise << 0.25, 0.1, 0.1, 0.5;
  e.discrepancy = Eigen::MatrixXd::Zero(2, 2);
  const std::vector<LinearModel> curves = {curve(Eigen::Vector2d(0.8, 1.5)), curve(Eigen::Vector2d::Zero())};
  const double expected = -1.3122304194937564;  // shares of 3/4 and 1/4, scipy.stats.multivariate_normal
  EXPECT_NEAR(computeLogDensity(Eigen::Vector2d(1.0, 2.0), curves, {std::log(3.0), 0.0}, e), expected, 1e-12);
  EXPECT_NEAR(computeLogDensity(Eigen::Vector2d(1.0, 2.0), curves, {0.0, -std::log(3.0)}, e), expected, 1e-12);
}

TEST(LogDensity, WhatComesAQuarterOfASecondEarlyIsNotWrongWhereDelaysAreOpen) {
  const auto step = [](double at) {
    return curve(1000.0 * (Eigen::ArrayXd::LinSpaced(40, 0.125, 9.875) > at).cast<double>());
  };
  ErrorModel e;
  e.noise = 2500.0 * Eigen::MatrixXd::Identity(40, 40);
  e.discrepancy = Eigen::MatrixXd::Zero(40, 40);
  const double right = computeLogDensity(step(5.0).offset, {step(5.0)}, {0.0}, e);
  // One bin that is 20 deviations off.
  EXPECT_NEAR(computeLogDensity(step(5.0).offset, {step(4.75)}, {0.0}, e), right - 200.0, 1e-9);
  EXPECT_NEAR(computeLogDensity(step(5.0).offset, {step(4.75), step(5.0), step(5.25)}, {0.0, 0.0, 0.0}, e),
              right - std::log(3.0), 1e-9);
}

/// One datum y = a + noise of variance 0.01, a ~ N(0, 1), whose column may be off by 30 %.
struct OneDatum {
  LinearModel model;
  ErrorModel errors;
  UnknownDensity density;
  OneDatum() {
    model.offset = Eigen::VectorXd::Zero(1);
    model.columns = Eigen::MatrixXd::Ones(1, 1);
    model.prior_mean = Eigen::VectorXd::Zero(1);
    model.prior_sigma = Eigen::VectorXd::Ones(1);
    model.positive = {false};
    errors.noise = Eigen::MatrixXd::Constant(1, 1, 0.01);
    errors.discrepancy = Eigen::MatrixXd::Zero(1, 1);
  }
  LinearFit fit(double form) {
    return fitWithForm(Eigen::VectorXd::Ones(1), model, errors, 0, Eigen::MatrixXd::Constant(1, 1, form), density);
  }
};

// Integrals over two million points between -4 and 4 with numpy.
TEST(FitWithForm, EvidenceAndIntervalAreThoseOfTheIntegral) {
  OneDatum one;
  const LinearFit fit = one.fit(0.09);
  EXPECT_NEAR(fit.log_evidence, -1.5292655, 0.02);
  EXPECT_NEAR(fit.x[0], 0.8704, 0.05);
  EXPECT_NEAR(fit.covariance(0, 0), 0.09388, 0.1 * 0.09388);
  EXPECT_NEAR(computeQuantile({one.density}, 0.025), 0.5982, 0.03);
  EXPECT_NEAR(computeQuantile({one.density}, 0.5), 0.9682, 0.03);
  EXPECT_NEAR(computeQuantile({one.density}, 0.975), 1.7847, 0.05);
  one.model.positive = {true};
  EXPECT_NEAR(one.fit(0.09).log_evidence, -0.8361197, 0.02);
}

TEST(FitWithForm, WithoutFormItIsTheGaussian) {
  OneDatum one;
  const LinearFit fit = one.fit(0.0), gaussian = fitLinear(Eigen::VectorXd::Ones(1), one.model, one.errors);
  EXPECT_NEAR(fit.log_evidence, gaussian.log_evidence, 0.02);
  EXPECT_NEAR(fit.x[0], gaussian.x[0], 0.02);
  EXPECT_NEAR(fit.covariance(0, 0), gaussian.covariance(0, 0), 0.1 * gaussian.covariance(0, 0));

  LinearModel two = smallModel();
  UnknownDensity density;
  const LinearFit of_two = fitWithForm(kData, two, smallErrors(), 1, Eigen::MatrixXd::Zero(4, 4), density);
  const LinearFit dense = fitLinear(kData, two, smallErrors());
  EXPECT_NEAR(of_two.log_evidence, dense.log_evidence, 0.02);
  EXPECT_NEAR(of_two.x[0], dense.x[0], 0.02);
  EXPECT_NEAR(of_two.x[1], dense.x[1], 0.05);
}

TEST(Quantile, WeighsDensitiesByTheirEvidence) {
  // Two boxes, the second with three times the probability.
  const UnknownDensity low{{0.0, 1.0}, {0.0, 0.0}}, high{{2.0, 3.0}, {std::log(3.0), std::log(3.0)}};
  EXPECT_NEAR(computeQuantile({low, high}, 0.125), 0.5, 1e-9);
  EXPECT_NEAR(computeQuantile({low, high}, 0.625), 2.5, 1e-9);
}

TEST(Detectability, IsTheWhitenedNormOfWhatTheBaselineCannotExplain) {
  LinearModel m = smallModel();
  const Detectability d(m, smallErrors(), 1.0);
  const Eigen::VectorXd along = m.columns.col(0);
  m.prior_sigma.setConstant(1e6);  // free to explain it all
  EXPECT_LT(Detectability(m, smallErrors(), 1.0).of(along), 0.01 * d.of(along));
  EXPECT_NEAR(d.correlation(along, 3.0 * along), 1.0, 1e-12);
  LinearModel none = smallModel();
  none.columns = Eigen::MatrixXd::Zero(4, 2);
  EXPECT_NEAR(Detectability(none, smallErrors(), 1.0).of(Eigen::Vector4d(1, 0, 0, 1)), std::sqrt(5.0 + 2.0), 1e-12);
}

TEST(Detectability, OfRepeatsHasNoPartOfTheirScatter) {
  LinearModel none = smallModel();
  none.columns = Eigen::MatrixXd::Zero(4, 2);
  ErrorModel unit;
  unit.noise = Eigen::Matrix4d::Identity();
  unit.discrepancy = Eigen::Matrix4d::Zero();
  const Detectability d(none, unit, 1.0);
  const Eigen::Vector4d change(3, 0, 0, 0), one(0, 4, 0, 0), two(0, 0, 4, 0), three(0, 0, 0, 4);
  EXPECT_NEAR(d.of((change + one + change + two) / 2.0), std::sqrt(9.0 + 8.0), 1e-12) << "the mean has some";
  EXPECT_NEAR(d.ofRepeats({change + one, change + two}), 3.0, 1e-12);
  EXPECT_NEAR(d.ofRepeats({change + one, change + two, change + three}), 3.0, 1e-12);
  EXPECT_NEAR(d.ofRepeats({change + one}), 5.0, 1e-12) << "one tells no scatter";
  EXPECT_EQ(d.ofRepeats({one, -one}), 0.0);
}

TEST(LjungBox, PValueIsThatOfTheTextbook) {
  Eigen::VectorXd v(12);
  v << 0.3, -1.1, 0.8, 0.9, -0.2, 0.1, 1.4, -0.7, 0.05, -0.6, 0.2, 0.45;
  EXPECT_NEAR(computeLjungBox(v, 3), 0.4596478550628118, 1e-10);
  EXPECT_NEAR(computeAutocorrelation(v, 1)[1], -0.3112752338749385, 1e-12);
  EXPECT_EQ(computeLjungBox(v, 5), 1.0);  // too few values
}

TEST(ChiSquare, TailIsThatOfTheTables) {
  EXPECT_NEAR(computeChiSquareTail(3.841459, 1), 0.05, 1e-7);
  EXPECT_NEAR(computeChiSquareTail(18.307038, 10), 0.05, 1e-7);
  EXPECT_NEAR(computeChiSquareTail(37.566235, 20), 0.01, 1e-7);
  EXPECT_EQ(computeChiSquareTail(0.0, 5), 1.0);
}

TEST(LogMeanExp, IsTheLogOfTheMeanAndDoesNotOverflow) {
  EXPECT_NEAR(logMeanExp({0.0, std::log(3.0)}), std::log(2.0), 1e-15);
  EXPECT_NEAR(logMeanExp({2000.0, 2000.0}), 2000.0, 1e-12);
}

TEST(Covariance, MaternOfThreeHalvesIsEquation417) {
  EXPECT_NEAR(computeMatern32(0.3, 0.2), 0.2677566068644094, 1e-14);
  EXPECT_EQ(computeMatern32(0.0, 0.2), 1.0);
}

TEST(Covariance, NoiseHasItsVarianceOnTheDiagonalAndForgets) {
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(400, 0.0, 99.75);
  const Eigen::MatrixXd k = computeNoiseCovariance({30.0, 40.0}, time);
  EXPECT_NEAR(k(7, 7), 2500.0, 1e-9);
  EXPECT_GT(k(0, 1), k(0, 10));
  // After 99.75 s only the slowest third is left: exp(-99.75 / 30) of it.
  EXPECT_NEAR(k(0, 399), 1600.0 / 3.0 * std::exp(-99.75 / 30.0), 1e-6);
}

/// A lift at 0.05 m/s with this left of it at these ways.
ReferenceLift makeLift(const std::vector<double>& way_m, const std::vector<double>& residual_share) {
  ReferenceLift lift;
  lift.way_m = way_m;
  lift.residual_share = residual_share;
  for (const double way : way_m) lift.time_s.push_back(20.0 * way);
  return lift;
}

TEST(Covariance, ReferencesTeachTheirMeanAndScatter) {
  // Two lifts that are off by 2 and 4 %: mean 3 %, and each is 2 % from what the other says. At the end both are right.
  const std::vector<double> ways = {0.05, 0.06, 1.85, 1.86};
  const Discrepancy learned =
      learnDiscrepancy({makeLift(ways, {0.02, 0.02, 0.0, 0.0}), makeLift(ways, {0.04, 0.04, 0.0, 0.0})}, Discrepancy());
  ASSERT_EQ(learned.way_m.size(), 2u);
  EXPECT_NEAR(learned.way_m[0], 0.06, 1e-12);
  EXPECT_NEAR(learned.mean_share[0], 0.03, 1e-12);
  EXPECT_NEAR(learned.mean_share[1], 0.0, 1e-12);
  // Averaged over the neighbouring cells, of which there is one.
  EXPECT_NEAR(learned.sigma_share[0], std::sqrt(0.0004 / 2.0), 1e-12);
  EXPECT_TRUE(learned.modes_share.empty());
  EXPECT_NEAR(learned.rough_share, 0.0, 1e-9);
}

TEST(Covariance, WhatTheSimulatorIsOffGoesWithTheCollectorNotWithTheHoist) {
  // References: right up to 1 m, then 10 % too little. The collector stands at 0.9 m for a while, as on a rope that
  // stretches.
  Discrepancy d;
  d.way_m = {1.0, 1.1};
  d.mean_share = {0.0, 0.1};
  SimulatedForce force;
  for (int i = 0; i <= 200; ++i) {
    const double time = 0.05 * i;
    force.time_s.push_back(time);
    force.force_n.push_back(2000.0);
    force.way_m.push_back(time < 4.0 ? 0.225 * time : time < 6.0 ? 0.9 : 0.9 + 0.2 * (time - 6.0));
  }
  const SimulatedForce corrected = correctKnownDiscrepancy(d, HoistPath(), force);
  EXPECT_EQ(corrected.force_n[119], 2000.0) << "0.9 m";
  EXPECT_NEAR(corrected.force_n[135], 2000.0 + 2000.0 * 0.05, 1e-9) << "6.75 s, 1.05 m";
  EXPECT_NEAR(corrected.force_n[200], 2200.0, 1e-9) << "1.7 m";
  EXPECT_EQ(correctKnownDiscrepancy(Discrepancy(), HoistPath(), force).force_n, force.force_n) << "without references";
  const Eigen::VectorXd share = computeKnownShare(d, HoistPath(), Eigen::Vector2d(0.0, 0.1), Eigen::Vector2d(1.2, 1.2));
  EXPECT_EQ(share[0], 0.0) << "before the motion";
  EXPECT_EQ(share[1], 0.1);
}

/// A lift whose residual is a multiple of one curve, and in every place a little more or less than that by turns.
ReferenceLift makeReference(double multiple, double ripple) {
  std::vector<double> way_m, residual_share;
  for (int i = 0; i < 200; ++i) {
    way_m.push_back(0.01 * i + 0.005);
    residual_share.push_back(multiple * std::sin(way_m.back()) + (i % 2 == 0 ? ripple : -ripple));
  }
  ReferenceLift lift = makeLift(way_m, residual_share);
  lift.path = {{0.0, 40.0, 45.0}, {0.0, 2.0, 2.0}};
  return lift;
}

TEST(Covariance, ARestThatReferencesHaveIsUnrolledByTheLogarithmOfItsTime) {
  // Up 0.5 m, 10 s of rest, up. Each stage begins at the next whole cell of 4 cm: the rest at 0.52 m, the way on 0.16 m
  // times ln 11 later, which is 0.90 m.
  const HoistPath stops{{0.0, 10.0, 20.0, 30.0}, {0.0, 0.5, 0.5, 1.0}}, lifts{{0.0, 20.0}, {0.0, 1.0}};
  const auto rest = [](double rested_s) { return 0.52 + 0.16 * std::log(1.0 + rested_s); };
  const Eigen::Vector4d time_s(5.0, 12.0, 15.0, 25.0), way_m(0.25, 0.5, 0.5, 0.75);
  EXPECT_LT(
      (unrollWay(stagesOf(stops), stops, time_s, way_m) - Eigen::Vector4d(0.25, rest(2.0), rest(5.0), 1.17)).norm(),
      1e-12);
  EXPECT_LT((unrollWay(stagesOf(lifts), stops, time_s, way_m) - way_m).norm(), 1e-12) << "no reference rests there";
  EXPECT_EQ(unrollWay({}, stops, time_s, way_m), way_m) << "references of many procedures";
  const Eigen::Vector2d moving_s(8.0, 12.0), moved_m(0.4, 0.6);
  EXPECT_LT((unrollWay(stagesOf(stops), lifts, moving_s, moved_m) - Eigen::Vector2d(0.4, 1.02)).norm(), 1e-12)
      << "a lift without the rest leaves its places out";
}

TEST(Covariance, AWayThatIsCoveredTwiceHasPlacesForEachTime) {
  // Up 0.7 m, 2 s of rest, down 0.2 m, and up again at once; in the record 0.01 m higher, and with 6 s of rest, of
  // which references know two. The rest begins at 0.72 m, the way down at 0.92 m, the last one at 1.12 m.
  const HoistPath procedure{{0.0, 14.0, 16.0, 20.0, 40.0}, {0.0, 0.7, 0.7, 0.5, 1.5}};
  const HoistPath record{{0.0, 14.2, 20.2, 24.2, 44.2}, {0.0, 0.71, 0.71, 0.51, 1.51}};
  Eigen::VectorXd time_s(5), way_m(5), expected(5);
  time_s << 10.0, 19.0, 22.2, 26.2, 34.2;
  way_m << 0.5, 0.71, 0.61, 0.61, 1.01;
  expected << 0.5, 0.72 + 0.16 * std::log(3.0), 1.02, 1.22, 1.62;
  EXPECT_LT((unrollWay(stagesOf(procedure), record, time_s, way_m) - expected).norm(), 1e-12);
  // A plain lift comes by 0.6 m once, as the procedure does for the first time, and by 1 m after all of it.
  const HoistPath lift{{0.0, 30.0}, {0.0, 1.5}};
  EXPECT_LT((unrollWay(stagesOf(procedure), lift, Eigen::Vector2d(12.0, 20.0), Eigen::Vector2d(0.6, 1.0)) -
             Eigen::Vector2d(0.6, 1.62))
                .norm(),
            1e-12);
}

TEST(Covariance, ProceduresAreTheSameByTheirCornersNotByTheirRests) {
  const auto same = [](const HoistPath& a, const HoistPath& b) { return isSameProcedure(stagesOf(a), stagesOf(b)); };
  const HoistPath stop{{0.0, 10.0, 20.0, 40.0}, {0.0, 0.5, 0.5, 1.5}};
  EXPECT_TRUE(same(stop, {{0.0, 12.0, 50.0, 74.0, 80.0}, {0.0, 0.53, 0.53, 1.9, 1.9}}))
      << "slower, longer, rests at the end";
  EXPECT_FALSE(same(stop, {{0.0, 12.0, 22.0, 42.0}, {0.0, 0.55, 0.55, 1.5}})) << "0.05 m higher";
  EXPECT_FALSE(same(stop, {{0.0, 10.0, 20.0, 24.0}, {0.0, 0.5, 0.5, 0.3}})) << "goes down after the rest";
  EXPECT_FALSE(same(stop, {{0.0, 30.0}, {0.0, 1.5}})) << "without the rest";
}

TEST(Covariance, WhatIsLeftOfAKnownRestForgetsWithTheLogarithmOfItsTime) {
  // Up 0.5 m, 12 s of rest, up; bins 1 and 9 s after the stop. Without anything but what is left beside the modes.
  Observation o;
  o.path = {{0.0, 10.0, 22.0, 32.0}, {0.0, 0.5, 0.5, 1.0}};
  o.time_s = Eigen::Vector2d(11.0, 19.0);
  o.way_m = o.travel_m = Eigen::Vector2d(0.5, 0.5);
  Discrepancy d;
  d.procedure = stagesOf(o.path);
  d.way_m = {0.0, 2.0};
  d.mean_share = {0.0, 0.0};
  d.sigma_share = {0.05, 0.05};
  d.share_of_peak = d.rough_share = d.rest_share = d.turn_share = 0.0;
  d.length_m = 0.2;
  const Eigen::Vector2d ice(8000.0, 8000.0), chaos(0.0, 0.0);
  const double apart_m = 0.16 * std::log(10.0 / 2.0) + 0.002 * 8.0;
  const Eigen::MatrixXd left = computeDiscrepancyCovariance(d, o, ice, chaos);
  EXPECT_NEAR(left(0, 0), 400.0 * 400.0, 1e-6);
  EXPECT_NEAR(left(0, 1), 400.0 * 400.0 * computeMatern32(apart_m, 0.2), 1e-6);
  // A record that lifts through goes with the distance.
  o.path = {{0.0, 20.0}, {0.0, 1.0}};
  o.way_m = o.travel_m = Eigen::Vector2d(0.5, 0.54);
  EXPECT_NEAR(computeDiscrepancyCovariance(d, o, ice, chaos)(0, 1),
              400.0 * 400.0 * computeMatern32(0.04 + 0.002 * 8.0, 0.2), 1e-6);

  // So does what a stop leaves: 8 % of the largest force, over 0.15 m.
  o.path = {{0.0, 10.0, 22.0, 32.0}, {0.0, 0.5, 0.5, 1.0}};
  o.way_m = o.travel_m = Eigen::Vector2d(0.5, 0.5);
  d.sigma_share = {0.0, 0.0};
  d.turn_share = 0.08;
  const auto fade = [](double rested_s) {
    return std::exp(-(0.16 * std::log(1.0 + rested_s) + 0.002 * rested_s) / 0.15);
  };
  const Eigen::MatrixXd turn = computeDiscrepancyCovariance(d, o, ice, chaos);
  // Of the start, 0.5 m before, little is left.
  EXPECT_NEAR(turn(0, 0), std::pow(640.0 * fade(1.0), 2), 3e-4 * 640.0 * 640.0);
  EXPECT_NEAR(turn(1, 1), std::pow(640.0 * fade(9.0), 2), 3e-4 * 640.0 * 640.0);
}

TEST(Covariance, WhatTheSimulatorDoesWhileTheHoistRestsIsLearned) {
  // The simulator's force falls by 10 % of its level when the hoist stops and comes back with 1 s; nature's does not.
  const auto off = [](double rested_s) { return rested_s < 0.0 ? 0.0 : 0.1 * std::exp(-rested_s); };
  const auto rested = [](double rest_s, double share) {
    ReferenceLift lift;
    lift.path = {{0.0, 10.0, 10.0 + rest_s, 20.0 + rest_s}, {0.0, 0.5, 0.5, 1.0}};
    for (double time = 0.125; time < 20.0 + rest_s; time += kBinS) {
      const double moved_s = std::min(time, 10.0) + std::max(time - 10.0 - rest_s, 0.0);
      lift.time_s.push_back(time);
      lift.way_m.push_back(0.05 * moved_s);
      lift.residual_share.push_back(time < 10.0 + rest_s ? share * (time < 10.0 ? 0.0 : std::exp(10.0 - time)) : 0.0);
    }
    return lift;
  };
  const Discrepancy learned = learnDiscrepancy({rested(6.0, 0.09), rested(9.0, 0.11)}, Discrepancy());
  ASSERT_EQ(learned.procedure.size(), 3u);
  EXPECT_EQ(learned.procedure[1].duration_s, 6.0) << "as long as all of them rest";
  const ReferenceLift other = rested(14.0, 0.1);
  const Eigen::Map<const Eigen::VectorXd> time_s(other.time_s.data(), static_cast<Eigen::Index>(other.time_s.size())),
      way_m(other.way_m.data(), time_s.size());
  const Eigen::VectorXd share = computeKnownShare(learned, other.path, time_s, way_m);
  for (Eigen::Index i = 0; i < share.size(); ++i) {
    // Cells are a quarter of a second long at first, and between them lines are straight.
    if (time_s[i] < 9.0 || time_s[i] > 10.5)
      EXPECT_NEAR(share[i], time_s[i] < 24.0 ? off(time_s[i] - 10.0) : 0.0, 0.006);
  }
  EXPECT_TRUE(learnDiscrepancy({rested(6.0, 0.1), makeReference(0.0, 0.0)}, Discrepancy()).procedure.empty());
}

TEST(References, ARecordGoesWithThoseOfItsProcedureIfThereAreSix) {
  RecordRecipe lift, stop;
  stop.stages_s = {12.0, 8.0, 28.0, 5.0};
  const auto named = [](const RecordRecipe& recipe, const std::string& name) {
    return NamedRecord{name, makeRecord(recipe)};
  };
  IdentifyInput input;
  input.records = {named(lift, "lift"), named(stop, "stop")};
  for (int i = 0; i < 6; ++i) {
    input.references.push_back(named(stop, "stops"));
    if (i < 5) input.references.push_back(named(lift, "lifts"));
  }
  auto groups = groupReferences(input);
  ASSERT_EQ(groups.size(), 2u);
  EXPECT_EQ(groups[0].size(), 6u) << "of the record that stops";
  for (const NamedRecord& reference : groups[0]) EXPECT_EQ(reference.path, "stops");
  EXPECT_EQ(groups[1].size(), 11u) << "five lifts are too few";
  input.references.push_back(named(lift, "lifts"));
  groups = groupReferences(input);
  ASSERT_EQ(groups.size(), 2u);
  EXPECT_EQ(groups[0].size(), 6u);
  EXPECT_EQ(groups[0][0].path, "lifts");
  EXPECT_EQ(groups[1][0].path, "stops");
  input.records = {named(stop, "stop")};
  input.holdout = named(stop, "again");
  EXPECT_EQ(groupReferences(input).size(), 1u);
}

TEST(Covariance, IceUnlikeTheReferencesIsPredictedLessWell) {
  Discrepancy d;
  const IceValues sigma(0.06, 100.0, 5.0);
  EXPECT_EQ(computeIceFactor(d, IceValues(0.4, 900.0, 20.0), sigma), 1.0) << "without references";
  d.ice = {{0.55, 200.0, 50.0}, {0.65, 200.0, 50.0}};
  EXPECT_NEAR(computeIceFactor(d, IceValues(0.6, 200.0, 50.0), sigma), 1.0, 1e-12);
  // 1 + 1 / (1 + 2 (5/6)²) + 1: one deviation in a direction in which the references differ, one where they do not.
  EXPECT_NEAR(computeIceFactor(d, IceValues(0.66, 300.0, 50.0), sigma), 2.4186046511627906, 1e-9);
}

TEST(Covariance, OneReferenceSaysNothingOfTheScatter) {
  Discrepancy before;
  before.share = 0.07;
  const Discrepancy learned = learnDiscrepancy({makeLift({0.5}, {0.1})}, before);
  EXPECT_EQ(learned.mean_share, std::vector<double>{0.1});
  EXPECT_NEAR(learned.sigma_share[0], 0.07, 1e-15);
}

TEST(Covariance, WhatReferencesHaveInCommonBecomesAModeAndTheRestIsSmall) {
  // Multiples of 1, 2, 3, 4 %: standard deviation sqrt(5/3) %, a fifth of the variance more for the mean of four.
  std::vector<ReferenceLift> lifts;
  for (const double multiple : {0.01, 0.02, 0.03, 0.04}) lifts.push_back(makeReference(multiple, 0.003));
  const Discrepancy learned = learnDiscrepancy(lifts, Discrepancy());
  ASSERT_EQ(learned.modes_share.size(), 1u);
  const std::size_t last = learned.way_m.size() - 1;
  // Mean of the sine over the four bins of the last cell.
  const double sine = std::sin(learned.way_m[last]) * 0.5 * (std::cos(0.005) + std::cos(0.015));
  const double expected = 0.01 * std::sqrt(5.0 / 3.0) * std::sqrt(1.25) * sine;
  EXPECT_NEAR(std::abs(learned.modes_share[0][last]), expected, 1e-9);
  EXPECT_NEAR(learned.mean_share[last], 0.025 * sine, 1e-12);
  EXPECT_LT(learned.sigma_share[last], 1e-6) << "the others predict a lift but for its multiple";
  // The ripple of 0.3 % in cells of four: 4 * 0.003^2 over 3 degrees of freedom.
  EXPECT_NEAR(learned.rough_share, 0.003 * std::sqrt(4.0 / 3.0), 2e-4);
}

TEST(Covariance, LevelIsTheLargestMeanOverEightSeconds) {
  // Swell of 8 s leaves it as it is; a peak of one bin adds a 32nd.
  Eigen::VectorXd force(120);
  for (Eigen::Index i = 0; i < 120; ++i) force[i] = 3000.0 + 500.0 * std::sin(6.283185307179586 * 0.25 * i / 8.0);
  EXPECT_NEAR(computeLevel(force), 3000.0, 1e-9);
  EXPECT_NEAR(computeLevel(Eigen::Vector2d(100.0, 300.0)), 200.0, 1e-12);
  Eigen::VectorXd peak = Eigen::VectorXd::Zero(120);
  peak[60] = 3200.0;
  EXPECT_NEAR(computeLevel(peak), 100.0, 1e-12);
}

TEST(Covariance, ForceAtRestIsAsFarOffAsReferencesAreThere) {
  std::vector<ReferenceLift> lifts = {makeReference(0.01, 0.0), makeReference(0.02, 0.0)};
  lifts[0].rest_share = 0.003;
  lifts[1].rest_share = -0.004;
  Observation o;
  o.time_s = Eigen::Vector3d(-1.0, -0.5, 0.5);
  o.way_m = o.travel_m = Eigen::Vector3d(0.0, 0.0, 0.02);
  o.path = {{0.0, 10.0}, {0.0, 0.5}};
  const Discrepancy learned = learnDiscrepancy(lifts, Discrepancy());
  const Eigen::Vector3d ice(0.0, 0.0, 8000.0), chaos(500.0, 500.0, 500.0);
  const Eigen::MatrixXd k = computeDiscrepancyCovariance(learned, o, ice, chaos);
  // With the 1 % of before as a third lift; the level is the mean of the three bins.
  const double level = 8000.0 / 3.0, square = (0.003 * 0.003 + 0.004 * 0.004 + 0.01 * 0.01) / 3.0;
  EXPECT_NEAR(k(0, 1), level * level * square, 1e-6);
  lifts[0].rest_share.reset();
  EXPECT_FALSE(learnDiscrepancy(lifts, Discrepancy()).known_rest_share) << "one says nothing of the scatter";
  EXPECT_GT(computeDiscrepancyCovariance(Discrepancy(), o, ice, chaos)(0, 1), 500.0 * 500.0) << "without references";
}

TEST(Covariance, TurnsCountAsKnownWhereAllReferencesHaveThem) {
  std::vector<ReferenceLift> lifts = {makeReference(0.01, 0.0), makeReference(0.02, 0.0)};
  lifts[0].path = {{0.0, 14.0, 14.5, 40.5, 45.0}, {0.0, 0.7, 0.7, 2.0, 2.0}};
  EXPECT_EQ(learnDiscrepancy(lifts, Discrepancy()).turn_way_m, (std::vector<double>{0.0, 2.0}));
}

TEST(Covariance, TravelCountsTheWayDownAsWell) {
  EXPECT_EQ(computeTravel({{0.0, 10.0, 12.0, 16.0}, {0.0, 0.5, 0.5, 0.25}}),
            (std::vector<double>{0.0, 0.5, 0.5, 0.75}));
}

TEST(Covariance, TurnsAreWhereTheSpeedChangesByMoreThanHalf) {
  // Starts, goes on a little slower, stops, goes on, turns.
  const HoistPath path{{0.0, 10.0, 20.0, 25.0, 30.0, 40.0}, {0.0, 0.5, 0.9, 0.9, 1.1, 0.8}};
  EXPECT_EQ(findTurns(path), (std::vector<double>{0.0, 0.9, 0.9, 1.1}));
}

TEST(Covariance, WhatAnEffectsLawMayBeOffGrowsWithTheEffect) {
  Observation o;
  o.time_s = Eigen::Vector3d(0.5, 1.0, 20.0);
  o.travel_m = Eigen::Vector3d(0.0, 0.03, 1.0);
  Discrepancy d;
  d.form_share = 0.5;
  const Eigen::MatrixXd k = computeFormCovariance(d, o, Eigen::Vector3d(100.0, -200.0, 0.0), 0.0);
  EXPECT_NEAR(k(0, 0), 2500.0, 1e-9);
  EXPECT_NEAR(k(1, 1), 10000.0, 1e-9);
  EXPECT_LT(k(0, 1), 0.0);
  EXPECT_EQ(k(2, 2), 0.0);
}

/// What rises by 1000 N within a second is 500 N off if it comes half a second early or late.
TEST(Covariance, WhatHappensAtAMomentMayComeEarlyOrLate) {
  const Eigen::Index count = 61;
  Observation o;
  o.time_s = Eigen::VectorXd::LinSpaced(count, 0.0, 15.0);
  o.travel_m = o.way_m = 0.07 * o.time_s;
  const Eigen::VectorXd change_n = 1000.0 * (o.time_s.array() - 10.0).max(0.0).min(1.0);
  Discrepancy d = learnDiscrepancy({makeReference(0.01, 0.0), makeReference(0.02, 0.0)}, Discrepancy());
  const auto form = [&](double timing_sigma_s) { return computeFormCovariance(d, o, change_n, timing_sigma_s); };
  const Eigen::MatrixXd timing = form(0.5) - form(0.0);
  EXPECT_NEAR(timing(42, 42), 500.0 * 500.0, 1e-6) << "10.5 s, in the middle of the rise";
  EXPECT_NEAR(timing(38, 38), 0.0, 1e-6) << "9.5 s";
  EXPECT_NEAR(timing(60, 60), 0.0, 1e-6) << "15 s";
  EXPECT_NEAR(form(0.0)(60, 60), std::pow(d.form_share * 1000.0, 2), 1e-6);
  d.way_m.clear();
  EXPECT_TRUE(form(0.5).isApprox(form(0.0))) << "without references";
}

}  // namespace
}  // namespace brash_ice_rig
