#include "brash_ice_rig/rig/rig_commands.h"

#include <cmath>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/csv.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/rig/load_cell.h"

namespace brash_ice_rig {

std::string toCsvRow(const RigCommand& command) {
  std::string row = toText(command.time_s);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    row += ',';
    if (command.velocity_mps) row += toText((*command.velocity_mps)[axis]);
  }
  row += ',';
  if (command.fold_target) row += toText(*command.fold_target);
  row += command.tare ? ",1" : ",";
  for (const std::optional<double>& value : {command.load_cell_noise_n, command.load_cell_resolution_n}) {
    row += ',';
    if (value) row += toText(*value);
  }
  return row + '\n';
}

std::vector<RigCommand> readCommands(const std::string& path) {
  const auto refuse = [&](const std::string& rule) { return ConfigError("procedure.commands_file", path, rule); };
  const std::vector<std::string> names = {
      "time_s",      "velocity_x_mps", "velocity_y_mps",    "velocity_z_mps",
      "fold_target", "tare",           "load_cell_noise_n", "load_cell_resolution_n"};
  const CsvTable table = readCsv(path, names);
  if (!table.columns[0]) throw refuse("must have a column time_s");
  bool any = false;
  for (std::size_t column = 1; column < names.size(); ++column) any = any || table.columns[column].has_value();
  if (!any) {
    throw refuse(
        "must have one of the columns velocity_x_mps, ..., fold_target, tare, load_cell_noise_n, "
        "load_cell_resolution_n");
  }
  if (table.last_row_cut_off) throw refuse("the last line is cut off, and with it the end of the test");
  if (table.bad_cells > 0) {
    const CsvTable::BadCell& bad = *table.first_bad_cell;
    throw refuse("line " + std::to_string(table.line[bad.row]) + ": " + bad.column + " must be a number or empty, is " +
                 bad.text);
  }

  std::vector<RigCommand> commands(table.line.size());
  for (std::size_t row = 0; row < commands.size(); ++row) {
    RigCommand& command = commands[row];
    const auto cell = [&](std::size_t column) -> std::optional<double> {
      if (!table.columns[column]) return std::nullopt;
      const double value = (*table.columns[column])[row];
      if (std::isnan(value)) return std::nullopt;
      if (std::isinf(value)) {
        throw refuse("line " + std::to_string(table.line[row]) + ": " + names[column] + " must be finite");
      }
      return value;
    };
    const std::string line = "line " + std::to_string(table.line[row]) + ": ";
    const std::optional<double> time = cell(0);
    if (!time) throw refuse(line + "time_s must be a number");
    command.time_s = *time;
    if (row > 0 && command.time_s <= commands[row - 1].time_s) {
      throw refuse(line + "time_s must increase from row to row");
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::optional<double> speed = cell(1 + axis);
      if (!speed) continue;
      if (!command.velocity_mps) command.velocity_mps = Eigen::Vector3d::Zero();
      (*command.velocity_mps)[static_cast<Eigen::Index>(axis)] = *speed;
    }
    command.fold_target = cell(4);
    if (command.fold_target && !(*command.fold_target >= 0.0 && *command.fold_target <= 1.0)) {
      throw refuse(line + "fold_target must lie in 0..1");
    }
    const double tare = cell(5).value_or(0.0);
    if (tare != 0.0 && tare != 1.0) throw refuse(line + "tare must be 0, 1 or empty");
    command.tare = tare == 1.0;
    command.load_cell_noise_n = cell(6);
    command.load_cell_resolution_n = cell(7);
    try {
      if (command.load_cell_noise_n) checkLoadCellKey("noise_n", *command.load_cell_noise_n);
      if (command.load_cell_resolution_n) checkLoadCellKey("resolution_n", *command.load_cell_resolution_n);
    } catch (const ConfigError& error) {
      throw refuse(line + error.what());
    }
  }
  return commands;
}

}  // namespace brash_ice_rig
