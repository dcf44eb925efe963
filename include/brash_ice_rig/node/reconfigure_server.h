#pragma once

#include <functional>
#include <memory>
#include <optional>

#include <dynamic_reconfigure/server.h>
#include <ros/node_handle.h>
#include <boost/thread/recursive_mutex.hpp>

#include "brash_ice_rig/RigConfig.h"
#include "brash_ice_rig/node/live_options.h"

namespace brash_ice_rig {

/// All that cfg/Rig.cfg lets change while the node runs.
struct LiveSettings {
  LiveOptions options;
  double load_cell_noise_n = 0.0;       ///< of the present run; the scenario's again after a reset
  double load_cell_resolution_n = 0.0;  ///< the same
};

/// @throws ConfigError naming the first value that is out of range and its rule, in the words of whoever reads it
///   from parameter or scenario
void checkLiveSettings(const LiveSettings& settings);

RigConfig toConfig(const LiveSettings& settings);
LiveSettings fromConfig(const RigConfig& config);

/// dynamic_reconfigure for the node. A request with one bad value changes nothing, and the log says why; the usual
/// server would cut the value to its range without a word. The parameter server keeps what the node was started with.
class ReconfigureServer {
 public:
  /// What the server needs of the node. Called by callback threads; may wait.
  struct Rig {
    std::function<std::optional<LiveSettings>()> present;    ///< what holds now; empty while the node shuts down
    std::function<void(const LiveSettings& wanted)> change;  ///< all of it is in range
  };

  ReconfigureServer(const ros::NodeHandle& private_node, const LiveSettings& present, Rig rig);

  /// Tells clients what holds now, after something else has changed it. Not for the thread that serves the rig.
  void refresh();

 private:
  /// Neither cut to its range nor kept on the parameter server.
  struct Config : RigConfig {
    Config() = default;
    Config(const RigConfig& config) : RigConfig(config) {}
    void __clamp__() {}
    void __fromServer__(const ros::NodeHandle&) {}
    void __toServer__(const ros::NodeHandle&) const {}
  };

  void onRequest(Config& config);

  const Rig rig_;
  boost::recursive_mutex mutex_;
  dynamic_reconfigure::Server<Config> server_;
  bool started_ = false;
};

}  // namespace brash_ice_rig
