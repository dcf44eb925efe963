#include "brash_ice_rig/node/scenario_request.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "brash_ice_rig/node/split_list.h"

namespace brash_ice_rig {
namespace {

namespace fs = std::filesystem;

std::string resolve(const char* field, const std::string& name, const std::string& directory) {
  std::error_code error;
  const fs::path root = fs::canonical(directory, error);
  if (error) throw ConfigError("scenario_dir", directory, "must be a directory that can be read");
  const fs::path file = fs::canonical(root / name, error);
  const auto parting = std::mismatch(root.begin(), root.end(), file.begin(), file.end());
  if (error || parting.first != root.end() || !fs::is_regular_file(file, error)) {
    throw ConfigError(field, "\"" + name + "\"", "must be a file below " + root.string());
  }
  return file.string();
}

}  // namespace

ScenarioSources resolveScenarioRequest(const LoadScenarioRequest& request, const std::string& scenario_dir,
                                       const ScenarioSources& present) {
  ScenarioSources sources;
  sources.file = request.scenario.empty() ? present.file : resolve("scenario", request.scenario, scenario_dir);
  for (const std::string& name : splitList(request.overlays)) {
    sources.overlays.push_back(resolve("overlays", name, scenario_dir));
  }
  sources.settings = splitList(request.settings);
  for (const std::string& setting : sources.settings) {
    for (const char* key : {"procedure.motion_file", "procedure.commands_file"}) {
      if (setting.find(key) == std::string::npos) continue;
      throw ConfigError("settings", "\"" + setting + "\"", "must not name a file; a scenario file may");
    }
  }
  return sources;
}

std::string reasonAgainstLoad(const Snapshot& snapshot) {
  switch (snapshot.stage) {
    case Stage::kLower:
    case Stage::kUnfold:
    case Stage::kLift:
      return std::string("the rig is in stage ") + stageName(snapshot.stage) +
             "; wait for the end of the lift, or call ~reset first";
    default:
      break;
  }
  if (!snapshot.rig.crane_velocity_mps.isZero()) return "the crane moves; let it stop first";
  return "";
}

}  // namespace brash_ice_rig
