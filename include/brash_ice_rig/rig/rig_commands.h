#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace brash_ice_rig {

/// What the simulation was told at one step, and heeded.
struct RigCommand {
  double time_s = 0.0;  ///< of the test, at the beginning of the step that obeys it first; 0: end of settling and rest
  std::optional<Eigen::Vector3d> velocity_mps;   ///< of the crane tip, frame map; finite
  std::optional<double> fold_target;             ///< 0..1
  bool tare = false;                             ///< the reading at this time becomes zero
  std::optional<double> load_cell_noise_n;       ///< instead of load_cell.noise_n, from the next sample on; its range
  std::optional<double> load_cell_resolution_n;  ///< the same for load_cell.resolution_n

  /// Whether nothing is told, as in a row that only marks the end.
  bool empty() const { return !velocity_mps && !fold_target && !tare && !load_cell_noise_n && !load_cell_resolution_n; }
};

/// First line of a file of commands.
constexpr char kCommandsHeader[] =
    "time_s,velocity_x_mps,velocity_y_mps,velocity_z_mps,fold_target,tare,load_cell_noise_n,load_cell_resolution_n\n";

/// One line of such a file. Reading it gives the same bits.
std::string toCsvRow(const RigCommand& command);

/// Reads a CSV file of commands: columns time_s and any of velocity_x_mps, velocity_y_mps, velocity_z_mps, fold_target,
/// tare (1: yes), load_cell_noise_n, load_cell_resolution_n. An empty cell commands nothing; where one component of the
/// velocity is given, the others count as 0. A row with a time only marks the end.
/// @throws ConfigError naming procedure.commands_file: what readCsv() refuses, a missing or a cut-off row, none of the
///   columns but time_s, a cell that is no number, time that does not increase, a fold target outside 0..1, a tare
///   other than 0 or 1, noise or resolution outside the range of the key of that name
std::vector<RigCommand> readCommands(const std::string& path);

}  // namespace brash_ice_rig
