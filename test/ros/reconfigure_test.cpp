#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <dynamic_reconfigure/Reconfigure.h>
#include <geometry_msgs/WrenchStamped.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/String.h>

#include "brash_ice_rig/LoadScenario.h"
#include "brash_ice_rig/TakenCommand.h"
#include "brash_ice_rig/node/service_call.h"
#include "test_support.h"

namespace brash_ice_rig {
namespace {

using Values = std::map<std::string, double>;

/// @return all numbers as they are afterwards
Values set(const Values& numbers, const std::map<std::string, bool>& switches = {}) {
  dynamic_reconfigure::Reconfigure call;
  for (const auto& [name, value] : numbers) {
    dynamic_reconfigure::DoubleParameter parameter;
    parameter.name = name;
    parameter.value = value;
    call.request.config.doubles.push_back(parameter);
  }
  for (const auto& [name, value] : switches) {
    dynamic_reconfigure::BoolParameter parameter;
    parameter.name = name;
    parameter.value = value;
    call.request.config.bools.push_back(parameter);
  }
  callWhenOffered("rig_node/set_parameters", call);
  Values after;
  for (const auto& parameter : call.response.config.doubles) after[parameter.name] = parameter.value;
  return after;
}

void step(double duration_s) {
  const auto answer = callStep("rig_node/step", duration_s);
  ASSERT_TRUE(answer.success) << answer.message;
}

LoadScenario::Response load(const std::string& scenario, const std::string& overlays, const std::string& settings) {
  LoadScenario call;
  call.request.scenario = scenario;
  call.request.overlays = overlays;
  call.request.settings = settings;
  callWhenOffered("rig_node/load_scenario", call);
  return call.response;
}

/// Median time between two clouds, by their stamps, while the rig runs in real time: stepped, it outruns its queue. At
/// rest it repeats itself with stamps a microsecond apart.
double cloudPeriod(Listener<sensor_msgs::PointCloud2>& points, double wall_s) {
  points.messages.clear();
  EXPECT_TRUE(callTrigger("rig_node/resume").success);
  spinFor(wall_s);
  EXPECT_TRUE(callTrigger("rig_node/pause").success);
  std::vector<double> gaps_s;
  for (std::size_t k = 1; k < points.messages.size(); ++k) {
    const double gap_s = (points.messages[k].header.stamp - points.messages[k - 1].header.stamp).toSec();
    if (gap_s > 1e-3) gaps_s.push_back(gap_s);
  }
  if (gaps_s.size() < 3) return 0.0;
  std::nth_element(gaps_s.begin(), gaps_s.begin() + static_cast<std::ptrdiff_t>(gaps_s.size() / 2), gaps_s.end());
  return gaps_s[gaps_s.size() / 2];
}

// The rig stands paused at the start of small.yaml and is stepped.
class Reconfigure : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(callTrigger("rig_node/reset").success); }
};

TEST_F(Reconfigure, NoiseOfTheReadingBeginsWithTheNextSampleAndIsRecorded) {
  Listener<geometry_msgs::WrenchStamped> reading("load_cell/wrench"), truth("ground_truth/wrench");
  Listener<TakenCommand> commands("sim/commands");
  ASSERT_TRUE(reading.waitForConnection() && truth.waitForConnection() && commands.waitForConnection());
  step(0.1);
  EXPECT_EQ(set({{"load_cell_noise_n", 300.0}}).at("load_cell_noise_n"), 300.0);
  step(1.0);
  ASSERT_TRUE(waitFor([&] { return reading.messages.size() == 110 && truth.messages.size() == 110; }));
  double square = 0.0;
  for (std::size_t i = 0; i < 110; ++i) {
    const double error_n = reading.messages[i].wrench.force.z - truth.messages[i].wrench.force.z;
    if (i < 10) {
      EXPECT_EQ(error_n, 0.0) << i;
    } else {
      EXPECT_NE(error_n, 0.0) << i;
      square += error_n * error_n / 100.0;
    }
  }
  EXPECT_NEAR(std::sqrt(square), 300.0, 4.0 * 300.0 / std::sqrt(200.0));
  ASSERT_FALSE(commands.messages.empty());
  EXPECT_TRUE(commands.last().has_load_cell_noise);
  EXPECT_FALSE(commands.last().has_load_cell_resolution);
  EXPECT_EQ(commands.last().load_cell_noise_n, 300.0);
  EXPECT_NEAR(commands.last().time_s, -1.0 + 0.1, 1e-9);
  EXPECT_EQ(commands.last().index, 1u);

  // A reset is back at the scenario, and who looks at the settings sees that.
  Listener<dynamic_reconfigure::Config> updates("rig_node/parameter_updates");
  ASSERT_TRUE(updates.waitForConnection());
  ASSERT_TRUE(callTrigger("rig_node/reset").success);
  ASSERT_TRUE(waitFor([&] {
    if (updates.messages.empty()) return false;
    for (const auto& parameter : updates.last().doubles) {
      if (parameter.name == "load_cell_noise_n") return parameter.value == 0.0;
    }
    return false;
  }));
}

TEST_F(Reconfigure, RatesAndFieldsOfThePointsChangeAtOnce) {
  EXPECT_EQ(set({}).at("points_rate_hz"), 20.0) << "begins with the parameter";
  Listener<sensor_msgs::PointCloud2> points("ice/points");
  ASSERT_TRUE(points.waitForConnection());
  EXPECT_NEAR(cloudPeriod(points, 0.8), 0.05, 1e-6);
  ASSERT_FALSE(points.messages.empty());
  EXPECT_EQ(points.last().point_step, 32u);
  const Values after = set({{"points_rate_hz", 2.0}}, {{"points_pressure", false}, {"points_damage", false}});
  EXPECT_EQ(after.at("points_rate_hz"), 2.0);
  EXPECT_NEAR(cloudPeriod(points, 2.4), 0.5, 1e-6);
  std::string names;
  for (const auto& field : points.last().fields) names += field.name + " ";
  EXPECT_EQ(names, "x y z speed plastic_strain submerged ");
  EXPECT_EQ(points.last().point_step, 24u);
  EXPECT_EQ(points.last().data.size(), 24u * points.last().width);
  set({{"points_rate_hz", 20.0}}, {{"points_pressure", true}, {"points_damage", true}});
}

TEST_F(Reconfigure, RealTimeFactorChangesThePace) {
  Listener<SimStatus> status("sim/status");
  ASSERT_TRUE(status.waitForConnection());
  set({{"real_time_factor", 0.1}, {"status_rate_hz", 20.0}});
  ASSERT_TRUE(callTrigger("rig_node/resume").success);
  spinFor(1.0);
  EXPECT_NEAR(status.last().real_time_factor, 0.1, 0.03);
  EXPECT_EQ(status.last().real_time_factor_target, 0.1);
  EXPECT_EQ(set({{"real_time_factor", 0.5}}).at("real_time_factor"), 0.5);
  spinFor(1.0);
  EXPECT_NEAR(status.last().real_time_factor, 0.5, 0.15);
  ASSERT_TRUE(callTrigger("rig_node/pause").success);
  set({{"real_time_factor", 1.0}, {"status_rate_hz", 5.0}});
}

TEST_F(Reconfigure, OneBadValueChangesNothingAtAll) {
  const Values before = set({});
  EXPECT_EQ(set({{"points_rate_hz", 5.0}, {"real_time_factor", 0.0005}}), before);
  EXPECT_EQ(set({{"points_rate_hz", 5.0}, {"load_cell_noise_n", -1.0}}), before);
  EXPECT_EQ(set({{"status_rate_hz", 1e9}}), before);
  EXPECT_EQ(set({{"state_rate_hz", std::nan("")}}), before);
}

TEST_F(Reconfigure, ParameterServerKeepsWhatTheNodeWasStartedWith) {
  set({{"joints_rate_hz", 25.0}, {"load_cell_noise_n", 5.0}});
  EXPECT_FALSE(ros::param::has("rig_node/joints_rate_hz"));
  EXPECT_FALSE(ros::param::has("rig_node/load_cell_noise_n"));
  set({{"joints_rate_hz", 50.0}, {"load_cell_noise_n", 0.0}});
}

TEST_F(Reconfigure, ScenarioIsLoadedAtItsStartAndTimeGoesOn) {
  Listener<std_msgs::String> scenario("sim/scenario");
  Listener<SimStatus> status("sim/status");
  Listener<rosgraph_msgs::Clock> clock("/clock");
  Listener<TakenCommand> commands("sim/commands");
  ASSERT_TRUE(status.waitForConnection() && scenario.waitForConnection() && clock.waitForConnection());
  ASSERT_TRUE(waitFor([&] { return scenario.messages.size() == 1 && !status.messages.empty(); }));
  EXPECT_NE(scenario.last().data.find("lift_speed_mps: 0.05 "), std::string::npos);
  step(0.5);
  // The present file without its settings, and one more.
  const auto answer = load("", "", "load_cell.rate_hz=50; load_cell.noise_n=7; procedure.settle_duration_s=0.5");
  ASSERT_TRUE(answer.success) << answer.message;
  EXPECT_EQ(answer.message, "loaded \"Small pull-up for tests of the node\", the script drives, paused");
  ASSERT_TRUE(waitFor([&] { return scenario.messages.size() == 2; }));
  EXPECT_NE(scenario.last().data.find("lift_speed_mps: 0.1 "), std::string::npos);
  ASSERT_TRUE(status.waitForNew());
  EXPECT_NEAR(status.last().time_s, -0.5, 1e-9);
  EXPECT_TRUE(status.last().paused);
  EXPECT_EQ(commands.last().index, 0u);
  EXPECT_EQ(set({}).at("load_cell_noise_n"), 7.0) << "of the new scenario";
  step(0.2);
  spinFor(0.3);
  for (std::size_t k = 1; k < clock.messages.size(); ++k) {
    ASSERT_GE(clock.messages[k].clock, clock.messages[k - 1].clock);
  }
  // A reset is back at the scenario that was loaded last.
  ASSERT_TRUE(callTrigger("rig_node/reset").success);
  ASSERT_TRUE(status.waitForNew());
  EXPECT_NEAR(status.last().time_s, -0.5, 1e-9);
  EXPECT_EQ(scenario.messages.size(), 2u) << "and tells it only once";
  ASSERT_TRUE(load("", "", "procedure.lift_speed_mps=0.05").success);
}

TEST_F(Reconfigure, ScenarioIsRefusedWhileLiftingOrWrongAndTheTestGoesOn) {
  Listener<SimStatus> status("sim/status");
  ASSERT_TRUE(status.waitForConnection());
  EXPECT_EQ(load("../test/ros/small.yaml", "", "").message,
            "scenario = \"../test/ros/small.yaml\", must be a file below " BRASH_ICE_SOURCE_DIR "/config");
  EXPECT_NE(load("", "", "ice.void_fraction=2").message.find("ice.void_fraction = 2, must lie in "), std::string::npos);
  EXPECT_NE(load("", "", "ice.voids=2").message.find("unknown key ice.voids"), std::string::npos);
  step(1.2);
  const auto answer = load("scenarios/pull_up.yaml", "", "");
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.message, "the rig is in stage lift; wait for the end of the lift, or call ~reset first");
  ASSERT_TRUE(status.waitForNew([](const SimStatus& s) { return s.time_s > 0.1; }));
  EXPECT_NEAR(status.last().time_s, 0.2, 1e-9);
  EXPECT_EQ(status.last().stage, "lift");
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "reconfigure_test");
}
