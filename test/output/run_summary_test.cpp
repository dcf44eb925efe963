#include "brash_ice_rig/output/run_summary.h"

#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

namespace brash_ice_rig {
namespace {

ForceStatistics statisticsOf(double period_s, const std::vector<double>& forces_n) {
  ForceStatistics statistics(period_s);
  for (std::size_t i = 0; i < forces_n.size(); ++i) statistics.add(static_cast<double>(i) * period_s, forces_n[i]);
  return statistics;
}

TEST(ForceStatistics, PeakIsTheMaximumOfTheCentredOneSecondMean) {
  // Five samples span 1 s; the best five are 10 20 30 20 10, around 1.25 s.
  const ForceStatistics statistics = statisticsOf(0.25, {0, 0, 0, 10, 20, 30, 20, 10, 0, 0});
  EXPECT_DOUBLE_EQ(statistics.peak(), 18.0);
  EXPECT_DOUBLE_EQ(statistics.peakTime(), 1.25);
}

TEST(ForceStatistics, SpikeShorterThanASecondCountsByItsShare) {
  EXPECT_DOUBLE_EQ(statisticsOf(0.25, {0, 0, 0, 0, 0, 0, 1000, 0, 0, 0, 0, 0, 0}).peak(), 200.0);
}

TEST(ForceStatistics, PeakOfAForceThatOnlyPushesUpIsNegative) {
  EXPECT_DOUBLE_EQ(statisticsOf(0.5, {-5, -4, -3, -4, -5}).peak(), -11.0 / 3.0);
}

TEST(ForceStatistics, ResidualIsTheMeanOfTheLastFourAndAHalfSeconds) {
  std::vector<double> ramp(20);
  for (std::size_t i = 0; i < ramp.size(); ++i) ramp[i] = static_cast<double>(i);
  // Nine samples at 2 Hz: 11 to 19.
  EXPECT_DOUBLE_EQ(statisticsOf(0.5, ramp).residual(), 15.0);
}

TEST(ForceStatistics, ShortRunUsesAllItsSamples) {
  const ForceStatistics statistics = statisticsOf(0.25, {1, 2, 6});
  EXPECT_DOUBLE_EQ(statistics.peak(), 3.0);
  EXPECT_DOUBLE_EQ(statistics.peakTime(), 0.25);
  EXPECT_DOUBLE_EQ(statistics.residual(), 3.0);
}

TEST(ForceStatistics, NoSamplesGiveNoNumbers) {
  const ForceStatistics statistics(0.01);
  EXPECT_TRUE(statistics.empty());
  EXPECT_TRUE(std::isnan(statistics.peak()));
  EXPECT_TRUE(std::isnan(statistics.peakTime()));
  EXPECT_TRUE(std::isnan(statistics.residual()));
}

TEST(ForceStatistics, OneNanDoesNotSpoilTheWindowsWithoutIt) {
  const double nan = std::nan("");
  EXPECT_DOUBLE_EQ(statisticsOf(0.5, {nan, 0, 3, 6, 3, 0}).peak(), 4.0);
  EXPECT_DOUBLE_EQ(statisticsOf(0.5, {0, 3, 6, 3, 0, nan}).peak(), 4.0);
}

TEST(RunSummary, JsonHasTheKeysThatOthersRead) {
  RunSummary summary;
  summary.peak_force_n = 19432.0625;
  summary.peak_time_s = 22.61;
  summary.particle_count = 10000;
  summary.step_count = 12345678901;
  summary.threads = 2;
  summary.state_hash = 0x00c0ffee12345678u;
  summary.status = "fold_jammed: the \"umbrella\" sticks";
  const YAML::Node json = YAML::Load(toJson(summary));  // JSON is YAML
  const std::vector<std::string> keys = {"peak_force_n",
                                         "peak_time_s",
                                         "residual_force_n",
                                         "ice_peak_force_n",
                                         "ice_residual_force_n",
                                         "energy_crane_work_j",
                                         "energy_imbalance_ratio",
                                         "simulated_s",
                                         "wall_s",
                                         "real_time_factor",
                                         "ns_per_particle_step",
                                         "active_ratio",
                                         "particle_count",
                                         "step_count",
                                         "dt_s",
                                         "threads",
                                         "state_hash",
                                         "status"};
  std::vector<std::string> found;
  for (const auto& entry : json) found.push_back(entry.first.as<std::string>());
  EXPECT_EQ(found, keys);
  EXPECT_EQ(json["peak_force_n"].as<double>(), 19432.0625);
  EXPECT_EQ(json["peak_time_s"].as<double>(), 22.61);
  EXPECT_TRUE(json["energy_crane_work_j"].IsNull());  // no audit
  EXPECT_TRUE(json["energy_imbalance_ratio"].IsNull());
  EXPECT_EQ(json["particle_count"].as<int>(), 10000);
  EXPECT_EQ(json["step_count"].as<std::uint64_t>(), 12345678901u);
  EXPECT_EQ(json["state_hash"].as<std::string>(), "00c0ffee12345678");
  EXPECT_EQ(json["status"].as<std::string>(), summary.status);
}

TEST(RunSummary, JsonHasNullWhereThereIsNoNumber) {
  RunSummary summary;
  summary.peak_force_n = std::nan("");
  EXPECT_TRUE(YAML::Load(toJson(summary))["peak_force_n"].IsNull());
}

TEST(RunSummary, StatusIsOkOrNamesEachFlagWithItsRemedy) {
  EXPECT_EQ(statusText(StatusFlags(), false), "ok");
  EXPECT_EQ(statusText(StatusFlags(), true), "interrupted");
  StatusFlags flags;
  flags.set(StatusFlag::kTravelLimit);
  const std::string remedy = statusRemedy(StatusFlag::kTravelLimit);
  EXPECT_FALSE(remedy.empty());
  EXPECT_EQ(statusText(flags, false), "travel_limit: " + remedy);
  EXPECT_EQ(statusText(flags, true), "interrupted; travel_limit: " + remedy);
}

TEST(RunSummary, TextForPeopleRoundsAndNamesTheUnit) {
  RunSummary summary;
  summary.peak_force_n = 19432.4;
  summary.peak_time_s = 22.614;
  summary.status = "ok";
  const std::string text = describe(summary);
  EXPECT_NE(text.find("19432 N at 22.61 s"), std::string::npos) << text;
}

}  // namespace
}  // namespace brash_ice_rig
