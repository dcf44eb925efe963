#include "brash_ice_rig/node/reconfigure_server.h"

#include <cmath>
#include <functional>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "brash_ice_rig/config/config_error.h"

namespace brash_ice_rig {
namespace {

std::map<std::string, double> doublesOf(const RigConfig& config) {
  dynamic_reconfigure::Config message;
  config.__toMessage__(message);
  std::map<std::string, double> values;
  for (const auto& parameter : message.doubles) values[parameter.name] = parameter.value;
  return values;
}

std::map<std::string, bool> boolsOf(const RigConfig& config) {
  dynamic_reconfigure::Config message;
  config.__toMessage__(message);
  std::map<std::string, bool> values;
  for (const auto& parameter : message.bools) values[parameter.name] = parameter.value;
  return values;
}

std::string refusal(const std::function<void(LiveSettings&)>& spoil) {
  LiveSettings settings;
  spoil(settings);
  try {
    checkLiveSettings(settings);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "taken";
}

TEST(ReconfigureServer, SlidersEndWhereTheParametersOfTheSameNameDo) {
  const auto minimum = doublesOf(RigConfig::__getMin__()), maximum = doublesOf(RigConfig::__getMax__()),
             start = doublesOf(RigConfig::__getDefault__());
  const auto switches = boolsOf(RigConfig::__getDefault__());
  std::size_t numbers = 0, bools = 0;
  struct Visitor {
    std::function<void(const char*, double, const ParameterRange&)> number;
    std::function<void(const char*, bool)> flag;
    void operator()(const char* name, double value, const ParameterRange& range) const { number(name, value, range); }
    void operator()(const char* name, bool value) const { flag(name, value); }
  };
  const LiveOptions defaults;
  LiveOptions::visit(defaults, Visitor{[&](const char* name, double value, const ParameterRange& range) {
                                         ++numbers;
                                         ASSERT_EQ(minimum.count(name), 1u) << name;
                                         EXPECT_EQ(minimum.at(name), range.zero_allowed ? 0.0 : range.min) << name;
                                         EXPECT_EQ(maximum.at(name), range.max) << name;
                                         EXPECT_EQ(start.at(name), value) << name;
                                       },
                                       [&](const char* name, bool value) {
                                         ++bools;
                                         ASSERT_EQ(switches.count(name), 1u) << name;
                                         EXPECT_EQ(switches.at(name), value) << name;
                                       }});
  EXPECT_EQ(numbers + 2, start.size()) << "all but the two of the load cell";
  EXPECT_EQ(bools, switches.size());
  for (const char* name : {"load_cell_noise_n", "load_cell_resolution_n"}) {
    const auto with = [&](double value) {
      return refusal([&](LiveSettings& s) {
        (std::string(name) == "load_cell_noise_n" ? s.load_cell_noise_n : s.load_cell_resolution_n) = value;
      });
    };
    EXPECT_EQ(with(minimum.at(name)), "taken");
    EXPECT_EQ(with(maximum.at(name)), "taken");
    EXPECT_NE(with(std::nextafter(maximum.at(name), 1e9)), "taken");
    EXPECT_NE(with(std::nextafter(minimum.at(name), -1.0)), "taken");
  }
}

TEST(ReconfigureServer, ConfigGivesBackEachSetting) {
  RigConfig config = RigConfig::__getDefault__();
  dynamic_reconfigure::Config message;
  config.__toMessage__(message);
  double next = 1.0;
  for (auto& parameter : message.doubles) parameter.value = next++;
  for (std::size_t i = 0; i < message.bools.size(); ++i) message.bools[i].value = i % 2 == 0;
  ASSERT_TRUE(config.__fromMessage__(message));
  const RigConfig back = toConfig(fromConfig(config));
  EXPECT_EQ(doublesOf(back), doublesOf(config));
  EXPECT_EQ(boolsOf(back), boolsOf(config));
}

TEST(ReconfigureServer, BadValueIsRefusedInTheWordsOfTheParameterOrTheScenario) {
  EXPECT_EQ(refusal([](LiveSettings&) {}), "taken");
  EXPECT_EQ(refusal([](LiveSettings& s) { s.options.real_time_factor = 0.0; }), "taken");
  EXPECT_EQ(refusal([](LiveSettings& s) { s.options.real_time_factor = 0.0005; }),
            "real_time_factor = 0.0005, must be a number in [0.001, 1000] or 0");
  EXPECT_EQ(refusal([](LiveSettings& s) { s.options.points_rate_hz = 0.0; }),
            "points_rate_hz = 0, must be a number in [0.1, 1000]");
  EXPECT_EQ(refusal([](LiveSettings& s) { s.options.status_rate_hz = 101.0; }),
            "status_rate_hz = 101, must be a number in [0.1, 100]");
  EXPECT_EQ(refusal([](LiveSettings& s) { s.options.state_rate_hz = std::nan(""); }),
            "state_rate_hz = nan, must be a number in [0.1, 1000]");
  EXPECT_EQ(refusal([](LiveSettings& s) { s.options.markers_force_scale_m_per_kn = 11.0; }),
            "markers_force_scale_m_per_kn = 11, must be a number in [0.001, 10]");
  EXPECT_EQ(refusal([](LiveSettings& s) { s.load_cell_noise_n = -1.0; }),
            "load_cell.noise_n = -1, must lie in [0, 100000]");
  EXPECT_EQ(refusal([](LiveSettings& s) { s.load_cell_resolution_n = std::nan(""); }),
            "load_cell.resolution_n = nan, must be a finite number");
}

}  // namespace
}  // namespace brash_ice_rig
