#include "brash_ice_rig/identify/observation.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "../output/temporary_directory.h"
#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/identify/candidate.h"
#include "brash_ice_rig/identify/curve_error.h"
#include "brash_ice_rig/identify/overlay.h"
#include "made_record.h"

namespace brash_ice_rig {
namespace {

Observation observe(const RecordRecipe& recipe) {
  const Record record = makeRecord(recipe);
  return makeObservation(record, checkRecord(record));
}

TEST(Observation, RecordsOfOneProcedureHaveTheSameWay) {
  RecordRecipe a, b;
  b.seed = 7;
  b.quiet_s = 13.7;
  const HoistPath first = observe(a).path, second = observe(b).path;
  EXPECT_EQ(first.time_s, second.time_s);
  EXPECT_EQ(first.height_m, second.height_m);
  ASSERT_GE(first.time_s.size(), 3u);
  EXPECT_EQ(first.time_s[0], 0.0);
  EXPECT_NEAR(first.time_s[1], 40.0, 0.11);
  EXPECT_NEAR(first.height_m[1], 2.08, 0.011);
}

TEST(Observation, StopsAreCornersOfTheWay) {
  RecordRecipe recipe;
  recipe.stages_s = {12.0, 8.0, 28.0, 5.0};
  const Observation o = observe(recipe);
  ASSERT_GE(o.path.time_s.size(), 5u);
  EXPECT_NEAR(o.path.time_s[1], 12.0, 0.21);
  EXPECT_NEAR(o.path.time_s[2], 20.0, 0.21);
  EXPECT_EQ(o.path.height_m[1], o.path.height_m[2]);
  // Distance covered does not grow while the hoist stands.
  const auto at = [&](double t) { return static_cast<Eigen::Index>(std::lround((t - o.time_s[0]) / kBinS)); };
  EXPECT_NEAR(o.travel_m[at(14.0)], o.travel_m[at(18.0)], 1e-12);
}

TEST(Observation, BinsAreMeansWithoutTareAndNoiseIsThatOfTheRest) {
  RecordRecipe recipe;
  recipe.white_noise_n = 50.0;
  recipe.slow_noise_n = 0.0;
  recipe.tare_n = 300.0;
  const Observation o = observe(recipe);
  const double rest = o.force_n.head(20).mean();
  EXPECT_NEAR(rest, 0.0, 15.0);
  // 12 or 13 samples a bin at 50 Hz.
  EXPECT_NEAR(o.noise.white_n, 50.0 / std::sqrt(12.5), 2.0);
  EXPECT_NEAR(o.time_s[1] - o.time_s[0], kBinS, 1e-12);
}

TEST(Observation, SlowNoiseIsFoundAlthoughAFewSecondsShowLittleOfIt) {
  // Noise after the model that is fitted: Gauss-Markov processes of 0.5, 4 and 30 s in equal parts. Over 6 s the last
  // one hardly leaves the place where it begins.
  for (const double slow_n : {50.0, 150.0}) {
    double square = 0.0;
    constexpr int kRecords = 40;
    for (int seed = 1; seed <= kRecords; ++seed) {
      RecordRecipe recipe;
      recipe.seed = static_cast<unsigned>(seed);
      recipe.white_noise_n = 70.0;
      recipe.slow_noise_n = 0.0;
      Record record = makeRecord(recipe);
      std::mt19937_64 generator(static_cast<unsigned>(100 + seed));
      std::normal_distribution<double> normal;
      for (const double time_s : {0.5, 4.0, 30.0}) {
        const double sigma = slow_n / std::sqrt(3.0), keep = std::exp(-0.02 / time_s);
        double slow = sigma * normal(generator);
        for (double& force : record.force_n) {
          force += slow;
          slow = keep * slow + std::sqrt(1.0 - keep * keep) * sigma * normal(generator);
        }
      }
      const double found = makeObservation(record, checkRecord(record)).noise.slow_n;
      square += found * found / kRecords;
    }
    EXPECT_NEAR(std::sqrt(square) / slow_n, 1.0, 0.25) << slow_n;
  }
}

TEST(Observation, MeanOverABinIsTheIntegralOfTheBrokenLine) {
  const std::vector<double> time = {0.0, 0.1, 0.2, 0.3, 0.4, 0.5}, force = {0.0, 1.0, 2.0, 3.0, 4.0, 5.0};
  const Eigen::VectorXd bins = Eigen::Vector3d(-1.0, 0.25, 9.0);
  const Eigen::VectorXd means = binned(time, force, bins);
  EXPECT_EQ(means[0], 0.0);
  EXPECT_NEAR(means[1], 2.5, 1e-12);
  EXPECT_NEAR(means[2], 5.0, 1e-12);
  EXPECT_NEAR(binned(time, force, bins, 0.1)[1], 1.5, 1e-12);
}

TEST(Candidates, EachEffectOfTheLibraryIsTriedInSomeWay) {
  for (const EffectDescription& effect : effectRegistry()) {
    const std::string name = effect.name;
    const auto variants = makeVariants(effect, PositionOrigin::kCommanded);
    if (name == "block_drop" || name == "vessel_heave") {
      EXPECT_TRUE(variants.empty()) << name;
      continue;
    }
    ASSERT_FALSE(variants.empty()) << name;
    for (const Variant& v : variants) {
      Scenario s;
      Eigen::VectorXd a(static_cast<Eigen::Index>(v.amplitudes.size()));
      for (Eigen::Index k = 0; k < a.size(); ++k) a[k] = v.amplitudes[static_cast<std::size_t>(k)].step;
      v.apply(s.effects[name], a);
      EXPECT_TRUE(s.effects[name].enabled) << name;
      EXPECT_NO_THROW(s.validate()) << name << " " << v.label;
    }
  }
}

TEST(Candidates, AShapeIsTriedAtItsMedianAndOneDeviationToEitherSide) {
  const auto drain = makeVariants(*findEffect("drainage"), PositionOrigin::kMeasured);
  ASSERT_EQ(drain.size(), 3u);
  const double expected[] = {4.9658530379, 10.0, 20.1375270747};  // log_normal(10, 0.7): 10 exp(-0.7), 10, 10 exp(0.7)
  for (std::size_t k = 0; k < drain.size(); ++k) {
    Scenario s;
    drain[k].apply(s.effects["drainage"], Eigen::VectorXd::Constant(1, 0.2));
    EXPECT_NEAR(s.effects["drainage"]["drain_time_s"], expected[k], 1e-9);
  }
  // What a lift does not tell keeps its default: freeze_bonds has a slip and a switch.
  EXPECT_EQ(makeVariants(*findEffect("freeze_bonds"), PositionOrigin::kMeasured).size(), 1u);
}

TEST(Candidates, AMeasuredPositionHasTheLossOfSpeedInItAlready) {
  for (const EffectDescription& effect : effectRegistry()) {
    if (std::string(effect.name) != "crane_speed") continue;
    EXPECT_TRUE(makeVariants(effect, PositionOrigin::kMeasured).empty());
    EXPECT_EQ(makeVariants(effect, PositionOrigin::kCommanded).size(), 1u);
  }
}

TEST(Candidates, SwellOfSineAndCosineHasTheirAmplitudeAndPhase) {
  const Variant v = makeSwell({6.0, 9.0}, false);
  Scenario s;
  v.apply(s.effects["vessel_heave"], Eigen::Vector4d(0.03, 0.04, 0.0, -0.02));
  EffectValues& heave = s.effects["vessel_heave"];
  EXPECT_NEAR(heave["amplitude_1_m"], 0.05, 1e-15);
  EXPECT_NEAR(heave["phase_1_deg"], 53.13010235415598, 1e-12);  // atan2(4, 3)
  EXPECT_NEAR(heave["phase_2_deg"], -90.0, 1e-12);
  EXPECT_EQ(heave["amplitude_3_m"], 0.0);
}

TEST(Candidates, AmplitudesStayWhereTheyCanBeSimulated) {
  for (const EffectDescription& effect : effectRegistry()) {
    for (const Variant& v : makeVariants(effect, PositionOrigin::kCommanded)) {
      for (const Amplitude& a : v.amplitudes) {
        EXPECT_LT(a.least, a.most) << effect.name;
        EXPECT_TRUE(std::isfinite(a.least) && std::isfinite(a.most)) << effect.name;
        if (a.positive) EXPECT_GE(a.least, 0.0) << effect.name << " " << a.name;
      }
    }
  }
  for (const Amplitude& a : makeSwell({6.0}, false).amplitudes) EXPECT_EQ(a.least, -a.most);  // sine and cosine
  for (const Amplitude& a : makeFalls({20.0}).amplitudes) EXPECT_EQ(a.least, 0.0);
}

TEST(CurveErrors, MeanErrorCountsTheRestBeforeTheLiftAndPeaksDoNot) {
  Observation o;
  o.time_s = Eigen::VectorXd::LinSpaced(48, -1.875, 9.875);  // 8 bins at rest, 40 in motion
  o.force_n = Eigen::VectorXd::Constant(48, 5000.0);
  Eigen::VectorXd curve = o.force_n;
  curve.head(8).array() -= 900.0;  // a zero error of the cell that shows at rest only
  const CurveError e = computeError(o, curve, Eigen::MatrixXd::Identity(48, 48));
  EXPECT_NEAR(e.rmse_n, 900.0 * std::sqrt(8.0 / 48.0), 1e-9);
  EXPECT_NEAR(e.nrmse_ratio, e.rmse_n / 5000.0, 1e-12);
  EXPECT_EQ(e.peak_error_n, 0.0);
  EXPECT_EQ(e.residual_level_error_n, 0.0);
  EXPECT_EQ(e.max_abs_n, 0.0);
}

/// A pole of 6 m whose foot goes aside by so much; 12 kN hang on it but in the first 2 s, when noise looks like more.
std::vector<Variant> tiltsAlong(double direction_deg, const Eigen::VectorXd& time_s, const Eigen::VectorXd& way_m) {
  Eigen::VectorXd tension_n = Eigen::VectorXd::Constant(time_s.size(), 12000.0);
  Eigen::VectorXd along_n = -tension_n.cwiseProduct(way_m) / 6.0;
  for (Eigen::Index i = 0; i < time_s.size() && time_s[i] < 2.0; ++i) {
    tension_n[i] = 100.0;
    along_n[i] = 500.0;
  }
  return makeLeaningTilts(direction_deg, 6.0, time_s, tension_n, along_n);
}

TEST(Candidates, TiltSeenSidewaysGoesBothWaysAlongItsDirection) {
  const Eigen::VectorXd time_s = Eigen::VectorXd::LinSpaced(41, 0.0, 40.0);
  const std::vector<Variant> leaning = tiltsAlong(30.0, time_s, -0.012 * time_s), upright = makeUprightTilts(30.0);
  ASSERT_EQ(leaning.size(), 7u);  // drift, sway of four periods, drift with the two longer ones
  ASSERT_EQ(upright.size(), 2u);
  EffectsConfig effects;
  EffectValues& values = effects["pole_tilt"];
  leaning[0].apply(values, Eigen::VectorXd::Constant(1, -0.004));
  EXPECT_TRUE(values.enabled);
  EXPECT_EQ(values["drift_mps"], -0.004);
  EXPECT_EQ(values["direction_deg"], 30.0);
  EXPECT_EQ(values["sway_m"], 0.0);
  EXPECT_EQ(values["lean_ratio"], 1.0);
  EXPECT_NEAR(leaning[0].amplitudes[0].step, -0.012, 1e-12) << "where a lean fits the lateral force";
  EXPECT_NEAR(leaning[4].amplitudes[0].step, -0.012, 1e-12) << "and none of it is swaying";
  EXPECT_NEAR(std::abs(leaning[4].amplitudes[1].step), 0.1, 1e-12);
  EXPECT_EQ(upright[0].amplitudes[0].step, 0.005) << "an upright pole reads the ice instead";
  for (const auto* tilts : {&leaning, &upright}) {
    for (const Variant& tilt : *tilts) {
      EXPECT_LT(tilt.amplitudes[0].least, 0.0) << tilt.label;
      EXPECT_EQ(tilt.amplitudes[0].least, -tilt.amplitudes[0].most) << tilt.label;
    }
  }
  const auto told = leaning[0].estimate(Eigen::VectorXd::Constant(1, -0.004), Eigen::MatrixXd::Constant(1, 1, 1e-6));
  EXPECT_EQ(told[0].value, -0.004);
  EXPECT_EQ(told[1].value, 30.0);
  const Variant& both = leaning[6];
  ASSERT_EQ(both.amplitudes.size(), 3u);
  both.apply(values, Eigen::Vector3d(0.006, -0.12, 0.0));
  EXPECT_EQ(values["drift_mps"], 0.006);
  EXPECT_DOUBLE_EQ(values["sway_m"], 0.12);
  EXPECT_NEAR(values["sway_period_s"], 15.0 * std::exp(1.0), 1e-12);
  EXPECT_DOUBLE_EQ(both.estimate(Eigen::Vector3d(0.006, -0.12, 0.0), Eigen::Matrix3d::Identity())[1].value, 0.12);
  const Variant& sway = upright.back();
  ASSERT_EQ(sway.amplitudes.size(), 1u);
  sway.apply(values, Eigen::VectorXd::Constant(1, -0.12));
  EXPECT_EQ(values["lean_ratio"], 0.0);
  EXPECT_EQ(values["drift_mps"], 0.0);
  EXPECT_DOUBLE_EQ(values["sway_m"], 0.12);
  EXPECT_DOUBLE_EQ(values["sway_phase_deg"], 180.0);
  EXPECT_EQ(values["sway_period_s"], 15.0);
  EXPECT_DOUBLE_EQ(sway.estimate(Eigen::VectorXd::Constant(1, -0.12), Eigen::MatrixXd::Identity(1, 1))[0].value, 0.12);
}

TEST(Candidates, ALeaningPoleShowsItsTensionTimesWayOverLength) {
  const Eigen::VectorXd time_s = Eigen::VectorXd::LinSpaced(43, -2.0, 40.0);
  const Eigen::VectorXd tension_n = 2000.0 + 300.0 * time_s.array();
  const auto tilts = makeLeaningTilts(0.0, 5.0, time_s, tension_n, Eigen::VectorXd::Zero(43));
  // At 30 s 11 kN hang on it. Drift of 1 m/s: -11 kN 30 m / 5 m.
  EXPECT_NEAR(tilts[0].lateral_n(32, 0), -66000.0, 1e-8);
  EXPECT_EQ(tilts[0].lateral_n(1, 0), 0.0) << "before the lift it stands upright";
  // Sway of 15 s: after two periods it is back.
  EXPECT_NEAR(tilts[2].lateral_n(32, 0), 0.0, 1e-8);
  EXPECT_NEAR(tilts[2].lateral_n(32, 1), 0.0, 1e-8);
  // At 5 s, a third of the period: sin = sqrt(3) / 2, cos - 1 = -3 / 2; 3.5 kN.
  EXPECT_NEAR(tilts[2].lateral_n(7, 0), -700.0 * 0.8660254038, 1e-6);
  EXPECT_NEAR(tilts[2].lateral_n(7, 1), 700.0 * 1.5, 1e-8);
  // Drift and sway together are drift, then sway.
  EXPECT_EQ(tilts[4].lateral_n.col(0), tilts[0].lateral_n.col(0));
  EXPECT_EQ(tilts[4].lateral_n.rightCols(2), tilts[3].lateral_n);
}

TEST(Candidates, SineAndCosineOfASwayAreItsSizeAndPhase) {
  const Eigen::VectorXd time_s = Eigen::VectorXd::LinSpaced(41, 0.0, 40.0);
  const Variant sway = tiltsAlong(0.0, time_s, time_s)[2];
  ASSERT_EQ(sway.amplitudes.size(), 2u);
  EffectsConfig effects;
  EffectValues& values = effects["pole_tilt"];
  // 0.3 sin(p t) + 0.4 (cos(p t) - 1) = 0.5 (sin(p t + phase) - sin(phase)) with tan(phase) = 4/3
  sway.apply(values, Eigen::Vector2d(0.3, 0.4));
  EXPECT_DOUBLE_EQ(values["sway_m"], 0.5);
  EXPECT_NEAR(values["sway_phase_deg"], 53.130102354, 1e-8);
  EXPECT_EQ(values["drift_mps"], 0.0);
  const auto told =
      sway.estimate(Eigen::Vector2d(0.3, 0.4), Eigen::Vector2d(0.01, 0.04).cwiseAbs2().asDiagonal().toDenseMatrix());
  ASSERT_EQ(told.size(), 3u);
  // Errors along and across (0.6, 0.8).
  EXPECT_NEAR(told[0].high - told[0].value, 1.96 * std::hypot(0.6 * 0.01, 0.8 * 0.04), 1e-12);
  EXPECT_EQ(told[1].key, "effects.pole_tilt.sway_phase_deg");
  EXPECT_NEAR(told[1].high - told[1].value, 1.96 * std::hypot(0.8 * 0.01, 0.6 * 0.04) / 0.5 * 57.29577951, 1e-6);
}

TEST(Candidates, SwellOfOnePeriodTellsWhatAnotherWouldDo) {
  // A mass of 200 kg on a spring of 9 kN/m that is moved up and down: F = k u + m u'', both in closed form.
  constexpr double kStiffness = 9000.0, kMass = 200.0, kTurn = 6.283185307179586;
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(120, -0.875, 28.875);
  const auto moved = [&](double period_s) {
    const double pitch = kTurn / period_s, per_metre = kStiffness - kMass * pitch * pitch;
    Eigen::MatrixXd columns(120, 2);
    columns.col(0) = per_metre * (pitch * time.array()).sin();
    columns.col(1) = per_metre * (pitch * time.array()).cos();
    return columns;
  };
  for (const double period_s : {3.0, 6.0, 10.0}) {
    const Eigen::MatrixXd found = swellResponse(moved(6.0), 6.0, period_s, time, Eigen::VectorXd::Constant(120, kMass));
    EXPECT_LT((found - moved(period_s)).cwiseAbs().maxCoeff(), 1.0) << period_s;
  }
}

TEST(Candidates, LoadCellActsOnTheForceAboveTheEmptyRig) {
  SimulatedForce force;
  for (int i = 0; i < 10; ++i) {
    force.time_s.push_back(0.05 * i);
    force.force_n.push_back(1000.0 * i);
    force.empty_force_n.push_back(0.0);
  }
  Scenario s;
  EffectValues& scale = s.effects["load_cell_scale"];
  scale.enabled = true;
  scale.set("error_ratio", 0.1);
  const SimulatedForce read = throughLoadCell(scale, s, force);
  EXPECT_NEAR(read.force_n[9], 9900.0, 1e-9);
  EXPECT_EQ(read.empty_force_n[9], 0.0);
}

TEST(Overlay, MakesTheTwinOutOfTheDefaultScenario) {
  Scenario twin;
  twin.ice.void_fraction = 0.55;
  twin.procedure.start_gap_m = 0.02;
  twin.procedure.lift_duration_s = 7.0;  // not the twin's
  twin.field.seed = 9;
  twin.effects["drainage"].enabled = true;
  twin.effects["drainage"].set("held_ratio", 0.21);
  const TemporaryDirectory directory;
  ScenarioSources sources;
  sources.overlays = {directory.put("overlay.yaml", toOverlay(twin))};
  Scenario read = loadScenario(sources);
  EXPECT_EQ(read.ice.void_fraction, 0.55);
  EXPECT_EQ(read.procedure.start_gap_m, 0.02);
  EXPECT_EQ(read.procedure.lift_duration_s, 40.0);
  EXPECT_EQ(read.field.seed, 1u);
  EXPECT_TRUE(read.effects["drainage"].enabled);
  EXPECT_EQ(read.effects["drainage"]["held_ratio"], 0.21);
  EXPECT_EQ(toOverlay(Scenario()), "");
}

}  // namespace
}  // namespace brash_ice_rig
