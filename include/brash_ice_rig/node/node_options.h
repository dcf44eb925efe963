#pragma once

#include <string>

#include <ros/node_handle.h>

#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/node/live_options.h"
#include "brash_ice_rig/simulation/checkpoint.h"

namespace brash_ice_rig {

/// What the node reads from its private parameters.
struct NodeOptions {
  LiveOptions live;         ///< of the same names
  ScenarioSources sources;  ///< ~scenario, ~overlays, ~settings
  std::string output_dir;   ///< where force.csv, scenario.yaml, summary.json go; empty: nowhere
  bool start_paused = false;
  bool exit_at_end = false;    ///< end the node when the script is done
  bool publish_clock = true;   ///< only one node may own /clock
  std::string frame_prefix;    ///< before every frame name, e.g. "rig_2/"
  std::string scenario_dir;    ///< the only place where ~load_scenario finds files; empty: nowhere
  std::string checkpoint_dir;  ///< the only place where checkpoints are written and read; empty: nowhere
  std::string checkpoint_file = kCheckpointName;  ///< name there, where no other is given
  double checkpoint_every_s = 0.0;                ///< simulated time between two savings; 0: never
};

/// Whether a text can name a file in a directory, and none elsewhere: 1 to 200 characters that can be printed, no
/// slash, no dot at the beginning.
bool isPlainFileName(const std::string& name);

/// Reads, checks and, for ~working_dir, applies the parameters (relative paths start there).
/// @throws ConfigError naming parameter, value and rule: wrong type, out of range, unknown name
NodeOptions readNodeOptions(const ros::NodeHandle& private_node);

}  // namespace brash_ice_rig
