#include "brash_ice_rig/node/live_residual.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

constexpr double kStartS = 100.0;

LiveResidualSettings knownNoise() {
  LiveResidualSettings settings;
  settings.noise = ResidualNoise{30.0, 20.0, 2.0};
  settings.discrepancy_ratio = 0.02;
  settings.window_s = 11.0;
  return settings;
}

/// One sample of each stream in the middle of bin k.
void addBin(LiveResidual& residual, int k, double measured_n, double simulated_n) {
  const double stamp_s = kStartS + (k + 0.5) / 4.0;
  residual.addSimulated(stamp_s, simulated_n);
  residual.addMeasured(stamp_s, measured_n);
}

/// Ends the bins up to k.
std::vector<ResidualReport> takeUpTo(LiveResidual& residual, int k) {
  addBin(residual, k + 4, 0.0, 0.0);
  return residual.take();
}

// Numbers from numpy 1.24 and scipy 1.10: r = 40 sin(0.9 k²) + 25 cos(0.2 k) + 10 and F = 2000 + 30 k for bins k =
// 0..29, 33..59; K = 30² I + 20² exp(-|dt|/2 s) + 0.02² F F' exp(-|dt|/5 s); z = cholesky(K)^-1 r; chi2.sf, f.sf;
// Ljung-Box by its formula.
TEST(LiveResidual, WhitensAndTestsAsTheDenseCovarianceDoes) {
  LiveResidual residual(knownNoise());
  addBin(residual, -1, 0.0, 0.0);  // joined in the middle: does not count
  for (int k = 0; k < 60; ++k) {
    if (k >= 30 && k <= 32) continue;
    const double r = 40.0 * std::sin(0.9 * k * k) + 25.0 * std::cos(0.2 * k) + 10.0;
    addBin(residual, k, 2000.0 + 30.0 * k + r, 2000.0 + 30.0 * k);
  }
  const std::vector<ResidualReport> reports = takeUpTo(residual, 59);
  ASSERT_EQ(reports.size(), 57u);
  EXPECT_NEAR(reports[40].whitened_ratio, -0.3916813904, 1e-9);
  const ResidualReport& last = reports.back();
  EXPECT_NEAR(last.time_s, kStartS + 14.875, 1e-9);
  EXPECT_NEAR(last.whitened_ratio, -0.2821356576, 1e-9);
  EXPECT_NEAR(last.expected_sigma_n, 83.5772696371, 1e-8);
  EXPECT_NEAR(last.rms_n, 34.5047759120, 1e-8);
  EXPECT_EQ(last.test.bins, 57u);
  EXPECT_NEAR(last.test.chi2_ratio, 0.6799817289, 1e-9);
  EXPECT_NEAR(last.test.chi2_p, 0.969286292, 1e-8);
  EXPECT_NEAR(last.test.ljung_box_p, 0.0024258687575563487, 1e-10);
  EXPECT_EQ(last.window.bins, 41u);
  EXPECT_NEAR(last.window.chi2_ratio, 0.6798559768, 1e-9);
  EXPECT_NEAR(last.window.chi2_p, 0.9412955591, 1e-8);
  EXPECT_NEAR(last.window.ljung_box_p, 0.6046083921585864, 1e-8);
  EXPECT_FALSE(last.significant) << "no p below 1e-4";
}

// scipy: x = 3 sin(1.7 i²) + 1, i = 0..49.
TEST(LiveResidual, TailsAreThoseOfChiSquareAndFisher) {
  std::vector<double> x;
  for (int i = 0; i < 50; ++i) x.push_back(3.0 * std::sin(1.7 * i * i) + 1.0);
  const ResidualTest known = testWhitened(x, 0, INFINITY);
  EXPECT_NEAR(known.chi2_ratio, 5.7794439953447645, 1e-12);
  EXPECT_NEAR(known.chi2_p / 2.3539086989871247e-35, 1.0, 1e-8);
  EXPECT_NEAR(known.ljung_box_p, 0.9493396108886972, 1e-10);
  EXPECT_NEAR(testWhitened(x, 0, 9.0).chi2_p, 0.0040190454334902165, 1e-12) << "noise known from 9 values only";
  EXPECT_NEAR(testWhitened(x, 0, 9.0).ljung_box_p, 0.9999837911217389, 1e-12)
      << "chi2.sf(3.9553302487 / (1 + 50 / 9), 10)";
  EXPECT_TRUE(std::isnan(testWhitened(x, 11, 9.0).ljung_box_p)) << "39 bins are too few";
  EXPECT_TRUE(std::isnan(testWhitened(std::vector<double>(50, 0.0), 0, 9.0).ljung_box_p));
}

// numpy: y = 50 sin(1.3 i²) + 80 sin(0.11 i) + 3 i, i = 0..79; dense likelihood on the same grid, line taken off.
TEST(LiveResidual, NoiseOfARestIsTheMostLikelyOne) {
  std::vector<double> y;
  for (int i = 0; i < 80; ++i) y.push_back(50.0 * std::sin(1.3 * i * i) + 80.0 * std::sin(0.11 * i) + 3.0 * i);
  const ResidualNoise noise = estimateNoise(y, 0.25, 1.0);
  EXPECT_NEAR(noise.white_n, 35.19193295, 1e-6);
  EXPECT_NEAR(noise.slow_n, 53.75656554, 1e-6);
  EXPECT_EQ(noise.slow_time_s, 4.0);
  EXPECT_EQ(noise.degrees_of_freedom, 26.0);
  const ResidualNoise silent = estimateNoise(std::vector<double>(20, 5.0), 0.25, 2.0);
  EXPECT_EQ(silent.white_n, 2.0);
  EXPECT_EQ(silent.slow_n, 0.0);
}

/// A minute of measured = simulated + noise (white 50 N, slow 60 N over 2 s), and a step.
/// @return the first bin after `rest` that is significant, or -1
int firstSignificant(unsigned seed, const LiveResidualSettings& settings, int rest, int step_bin, double step_n) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  LiveResidual residual(settings);
  const double decay = std::exp(-0.25 / 2.0);
  double slow = 60.0 * normal(generator);
  for (int k = -1 - rest; k < 240; ++k) {
    slow = decay * slow + 60.0 * std::sqrt(1.0 - decay * decay) * normal(generator);
    const double simulated = 2000.0 + 50.0 * std::max(0, k);
    addBin(residual, k, simulated + slow + 50.0 * normal(generator) + (k >= step_bin ? step_n : 0.0), simulated);
    for (const ResidualReport& report : residual.take()) {
      if (report.significant) return static_cast<int>(std::floor((report.time_s - kStartS) * 4.0));
    }
  }
  return -1;
}

TEST(LiveResidual, NoiseAloneIsHardlyEverSignificant) {
  LiveResidualSettings known, learned;
  known.noise = ResidualNoise{50.0, 60.0, 2.0};
  known.discrepancy_ratio = learned.discrepancy_ratio = 0.0;  // or it would hide what the noise does
  int false_known = 0, false_learned = 0;
  constexpr int kRuns = 60;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    if (firstSignificant(seed, known, 0, 1000, 0.0) >= 0) ++false_known;
    if (firstSignificant(seed, learned, 80, 1000, 0.0) >= 0) ++false_learned;
  }
  // 960 looks at four tests each; at most 5 % of the tests may end with a false alarm.
  EXPECT_LE(false_known, 3);
  EXPECT_LE(false_learned, 3);
}

TEST(LiveResidual, StepOfAKilonewtonIsSignificantWithinASecond) {
  LiveResidualSettings settings;
  settings.noise = ResidualNoise{50.0, 60.0, 2.0};
  for (unsigned seed = 1; seed <= 20; ++seed) {
    // Simulated force 2 to 4 kN, of which 5 % count as the model's own error.
    const int bin = firstSignificant(seed, settings, 0, 40, 1000.0);
    EXPECT_GE(bin, 40);
    EXPECT_LE(bin, 43);
  }
}

TEST(LiveResidual, OrderWithinTheLatenessDoesNotMatterAndLaterIsLeftOut) {
  LiveResidual in_order(knownNoise()), shuffled(knownNoise());
  std::vector<ResidualReport> expected, found;
  const auto collect = [](LiveResidual& residual, std::vector<ResidualReport>& reports) {
    for (const ResidualReport& report : residual.take()) reports.push_back(report);
  };
  // 20 Hz; the measured stream comes 0.3 s late, and in pairs swapped.
  const auto force = [](int i) { return 1000.0 + 100.0 * std::sin(0.3 * i); };
  for (int i = 0; i < 200; ++i) {
    in_order.addSimulated(0.05 * i, 1000.0);
    in_order.addMeasured(0.05 * i, force(i));
    collect(in_order, expected);
    shuffled.addSimulated(0.05 * i, 1000.0);
    if (i >= 6) shuffled.addMeasured(0.05 * ((i - 6) ^ 1), force((i - 6) ^ 1));
    collect(shuffled, found);
  }
  for (int i = 194; i < 200; ++i) shuffled.addMeasured(0.05 * i, force(i));
  collect(shuffled, found);
  ASSERT_GT(expected.size(), 30u);
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i].whitened_ratio, expected[i].whitened_ratio, 1e-9);
  EXPECT_EQ(shuffled.lateSamples(), 0u);
  shuffled.addMeasured(2.0, 9e9);
  EXPECT_EQ(shuffled.lateSamples(), 1u);
  shuffled.addMeasured(NAN, 1.0);
  shuffled.addMeasured(11.0, NAN);
  EXPECT_NEAR(*shuffled.newestMeasured(), 9.95, 1e-9);
}

TEST(LiveResidual, OneStreamAloneGivesNothingAndIsNotKeptForEver) {
  LiveResidual residual(knownNoise());
  for (int i = 0; i < 20000; ++i) {
    residual.addSimulated(0.05 * i, 1000.0);
    EXPECT_TRUE(residual.take().empty());
  }
  EXPECT_FALSE(residual.newestMeasured());
  // The measured one joins at 1000 s: what waited in vain is left behind.
  std::size_t reports = 0;
  for (int i = 20000; i < 20200; ++i) {
    residual.addSimulated(0.05 * i, 1000.0);
    residual.addMeasured(0.05 * i, 1000.0);
    for (const ResidualReport& report : residual.take()) {
      EXPECT_GT(report.time_s, 1000.0);
      ++reports;
    }
  }
  EXPECT_GT(reports, 30u);
}

TEST(LiveResidual, LearnsAtRestUntilEnoughOrTheHoistMoves) {
  LiveResidualSettings settings;
  settings.learn_s = 5.0;
  LiveResidual residual(settings);
  addBin(residual, -1, 0.0, 0.0);
  for (int k = 0; k < 7; ++k) addBin(residual, k, 10.0 * (k % 2), 0.0);
  for (const ResidualReport& report : takeUpTo(residual, 3)) EXPECT_TRUE(report.learning);
  residual.stopLearning();
  EXPECT_FALSE(residual.noise()) << "four bins are no noise";
  for (int k = 8; k < 16; ++k) addBin(residual, k, 10.0 * (k % 2), 0.0);
  residual.take();
  EXPECT_GE(residual.learnedBins(), 8u);
  EXPECT_FALSE(residual.noise());
  residual.stopLearning();
  ASSERT_TRUE(residual.noise());
  EXPECT_GT(residual.noise()->white_n, 2.0);
  EXPECT_LT(residual.noise()->white_n, 10.0);
}

}  // namespace
}  // namespace brash_ice_rig
