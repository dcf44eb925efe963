#include "brash_ice_rig/node/reconfigure_server.h"

#include <sstream>
#include <string>
#include <utility>

#include <ros/console.h>

#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/rig/load_cell.h"

namespace brash_ice_rig {
namespace {

/// Calls copy(of config, of settings) for each value that both hold.
template <class Config, class Settings, class Copy>
void forEachPair(Config& config, Settings& settings, Copy copy) {
  copy(config.real_time_factor, settings.options.real_time_factor);
  copy(config.points_rate_hz, settings.options.points_rate_hz);
  copy(config.markers_rate_hz, settings.options.markers_rate_hz);
  copy(config.state_rate_hz, settings.options.state_rate_hz);
  copy(config.joints_rate_hz, settings.options.joints_rate_hz);
  copy(config.status_rate_hz, settings.options.status_rate_hz);
  copy(config.points_speed, settings.options.points_speed);
  copy(config.points_pressure, settings.options.points_pressure);
  copy(config.points_plastic_strain, settings.options.points_plastic_strain);
  copy(config.points_damage, settings.options.points_damage);
  copy(config.points_submerged, settings.options.points_submerged);
  copy(config.markers_force_scale_m_per_kn, settings.options.markers_force_scale_m_per_kn);
  copy(config.load_cell_noise_n, settings.load_cell_noise_n);
  copy(config.load_cell_resolution_n, settings.load_cell_resolution_n);
}

template <class Values>
void logChanges(const Values& before, const Values& after) {
  for (std::size_t i = 0; i < after.size(); ++i) {
    if (after[i].value == before[i].value) continue;
    ROS_INFO("%s = %s, was %s", after[i].name.c_str(), formatNumber(after[i].value).c_str(),
             formatNumber(before[i].value).c_str());
  }
}

void logChanges(const RigConfig& before, const RigConfig& after) {
  dynamic_reconfigure::Config from, to;
  before.__toMessage__(from);
  after.__toMessage__(to);
  logChanges(from.doubles, to.doubles);
  logChanges(from.bools, to.bools);
}

struct RangeCheck {
  void operator()(const char* name, double value, const ParameterRange& range) const {
    if (!range.contains(value)) throw ConfigError(name, formatNumber(value), range.rule());
  }
  void operator()(const char*, bool) const {}
};

}  // namespace

void checkLiveSettings(const LiveSettings& settings) {
  LiveOptions::visit(settings.options, RangeCheck());
  checkLoadCellKey("noise_n", settings.load_cell_noise_n);
  checkLoadCellKey("resolution_n", settings.load_cell_resolution_n);
}

RigConfig toConfig(const LiveSettings& settings) {
  RigConfig config = RigConfig::__getDefault__();
  forEachPair(config, settings, [](auto& to, const auto& from) { to = from; });
  return config;
}

LiveSettings fromConfig(const RigConfig& config) {
  LiveSettings settings;
  forEachPair(config, settings, [](const auto& from, auto& to) { to = from; });
  return settings;
}

ReconfigureServer::ReconfigureServer(const ros::NodeHandle& private_node, const LiveSettings& present, Rig rig)
    : rig_(std::move(rig)), server_(mutex_, private_node) {
  const boost::recursive_mutex::scoped_lock lock(mutex_);
  server_.updateConfig(toConfig(present));
  // Calls back at once, when there is nothing to change yet.
  server_.setCallback([this](Config& config, std::uint32_t) { onRequest(config); });
  started_ = true;
}

void ReconfigureServer::refresh() {
  const boost::recursive_mutex::scoped_lock lock(mutex_);
  if (const std::optional<LiveSettings> present = rig_.present()) server_.updateConfig(toConfig(*present));
}

/// Leaves in the config what holds afterwards, which becomes the answer.
void ReconfigureServer::onRequest(Config& config) {
  if (!started_) return;
  const LiveSettings wanted = fromConfig(config);
  const std::optional<LiveSettings> before = rig_.present();
  try {
    checkLiveSettings(wanted);
    rig_.change(wanted);
  } catch (const ConfigError& error) {
    ROS_ERROR("set_parameters: refused, nothing is changed: %s", error.what());
  }
  const std::optional<LiveSettings> after = rig_.present();
  if (!before || !after) return;
  config = toConfig(*after);
  logChanges(toConfig(*before), config);
}

}  // namespace brash_ice_rig
