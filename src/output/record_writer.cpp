#include "brash_ice_rig/output/record_writer.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/version.h"

namespace brash_ice_rig {
namespace {

namespace fs = std::filesystem;

constexpr const char* kHeader =
    "time_s,force_n,hoist_position_m,hoist_speed_mps,force_x_n,force_y_n,hoist_command_mps,"
    "crane_position_x_m,crane_position_y_m,fold_ratio,stage,flags\n";

/// NAME with its directory, which is made.
std::string prepare(const std::string& path) {
  std::error_code ignored;
  fs::path base(path);
  if (fs::is_directory(base, ignored) || !base.has_filename()) {
    base /= "record";
  } else if (base.extension() == ".csv" || base.extension() == ".yaml") {
    base.replace_extension();
  }
  base = fs::absolute(base).lexically_normal();
  makeDirectory(base.parent_path().string());
  // An older run's manifest would vouch for this one.
  std::error_code error;
  fs::remove(base.string() + ".yaml", error);
  if (error) throw OutputError(base.string() + ".yaml", error.message());
  return base.string();
}

}  // namespace

RecordWriter::RecordWriter(const Simulation&, const std::string& path)
    : base_(prepare(path)), csv_(csvPath(), OutputFile::Mode::kDirect), commands_(kCommandsHeader) {
  csv_.write(kHeader);
  csv_.flush();
}

void RecordWriter::write(const Snapshot& snapshot, const StepReport& report) {
  StatusFlags flags = report.flags;
  flags |= snapshot.flags;
  const RigState& rig = snapshot.rig;
  std::string row;
  for (const double value :
       {snapshot.time_s, snapshot.force_n, rig.hoist_position_m, rig.crane_velocity_mps.z(),
        snapshot.load_cell_force_n.x(), snapshot.load_cell_force_n.y(), rig.commanded_velocity_mps.z(),
        rig.crane_position_m.x(), rig.crane_position_m.y(), rig.fold_ratio}) {
    row += toText(value) + ',';
  }
  csv_.write(row + stageName(snapshot.stage) + ',' + std::to_string(flags.bits()) + '\n');

  const double empty_n = snapshot.components.weight_n - snapshot.components.buoyancy_n;
  empty_rig_n_ = std::min(empty_rig_n_.value_or(empty_n), empty_n);
  for (const RigCommand& command : report.commands) {
    commands_ += toCsvRow(command);
    if (command.tare) tared_n_ = snapshot.tension_n;
  }
  // A test that commands end is done with the sample after them.
  if (snapshot.stage != Stage::kDone) last_time_s_ = snapshot.time_s;
}

void RecordWriter::finish(const Simulation& simulation) {
  csv_.close();
  const std::string name = fs::path(base_).filename().string();
  // What lies beside it is named in the manifest: paths in a scenario start where a program was started.
  Scenario scenario = simulation.scenario();
  const std::string motion_file = scenario.procedure.motion_file;
  scenario.procedure.motion_file.clear();
  scenario.procedure.commands_file.clear();
  replaceFile(base_ + "_rig.yaml", std::string("# brash_ice_rig ") + kVersion + "\n" + toYaml(scenario));
  RigCommand end;
  end.time_s = last_time_s_;
  replaceFile(base_ + "_commands.csv", commands_ + toCsvRow(end));
  if (!motion_file.empty()) replaceFile(base_ + "_motion.csv", textOfFile(motion_file));

  YAML::Emitter manifest;
  manifest << YAML::BeginMap;
  manifest << YAML::Key << "title" << YAML::Value << scenario.title;
  manifest << YAML::Key << "source" << YAML::Value << "synthetic";
  manifest << YAML::Key << "tare_n" << YAML::Value << toText(empty_rig_n_.value_or(0.0) - tared_n_);
  manifest << YAML::Key << "position" << YAML::Value << "measured";
  manifest << YAML::Key << "rig" << YAML::Value << name + "_rig.yaml";
  manifest << YAML::Key << "commands" << YAML::Value << name + "_commands.csv";
  if (!motion_file.empty()) manifest << YAML::Key << "motion" << YAML::Value << name + "_motion.csv";
  manifest << YAML::Key << "notes" << YAML::Value
           << std::string("simulated by brash_ice_rig ") + kVersion + "; tare_n from the ground truth";
  manifest << YAML::EndMap;
  replaceFile(manifestPath(), std::string(manifest.c_str()) + "\n");
}

}  // namespace brash_ice_rig
