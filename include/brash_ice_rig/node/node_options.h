#pragma once

#include <string>

#include <ros/node_handle.h>

#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/simulation/checkpoint.h"

namespace brash_ice_rig {

/// What the node reads from its private parameters. Rates count samples per simulated second, but status_rate_hz.
struct NodeOptions {
  ScenarioSources sources;        ///< ~scenario, ~overlays, ~settings
  std::string output_dir;         ///< where force.csv, scenario.yaml, summary.json go; empty: nowhere
  double real_time_factor = 1.0;  ///< simulated s per wall s; 0: as fast as it can
  bool start_paused = false;
  bool exit_at_end = false;       ///< end the node when the script is done
  bool publish_clock = true;      ///< only one node may own /clock
  std::string frame_prefix;       ///< before every frame name, e.g. "rig_2/"
  double points_rate_hz = 10.0;   ///< ice/points
  double markers_rate_hz = 10.0;  ///< rig/markers
  double state_rate_hz = 10.0;    ///< crane/state, plug/state
  double joints_rate_hz = 50.0;   ///< joint_states, crane/cmd_vel_out
  double status_rate_hz = 5.0;    ///< sim/status, per wall s
  std::string checkpoint_dir;     ///< the only place where checkpoints are written and read; empty: nowhere
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
