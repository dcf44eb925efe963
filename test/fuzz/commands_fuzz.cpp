// The two CSV files that come with the record of a bag: commands, and the motion of the hoist.

#include <cmath>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/rig/crane_motion.h"
#include "brash_ice_rig/rig/rig_commands.h"
#include "fuzz_input.h"

namespace brash_ice_rig {
namespace {

std::string toCsv(const std::vector<RigCommand>& commands) {
  std::string text = kCommandsHeader;
  for (const RigCommand& command : commands) text += toCsvRow(command);
  return text;
}

void checkCommands(const FuzzDirectory& directory, const std::string& path) {
  std::vector<RigCommand> commands;
  try {
    commands = readCommands(path);
  } catch (const ConfigError&) {
    return;
  }
  const std::string text = toCsv(commands);
  try {
    require(toCsv(readCommands(directory.write("again.csv", text))) == text, "commands are read back as written");
  } catch (const ConfigError& error) {
    require(false, error.what());
  }
}

void checkMotion(const std::string& path) {
  try {
    const CraneMotion motion = CraneMotion::read(path);
    Scenario scenario;
    scenario.procedure.motion_file = path;
    scenario.validate();
    for (const double share : {0.0, 0.3, 1.0}) {
      require(std::isfinite(motion.wayAt(share * motion.duration())), "the way of a valid motion is finite");
    }
  } catch (const ConfigError&) {
  }
}

}  // namespace
}  // namespace brash_ice_rig

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace brash_ice_rig;
  static const FuzzDirectory kDirectory;
  const std::string path = kDirectory.write("input.csv", textOf(data, size));
  checkCommands(kDirectory, path);
  checkMotion(path);
  return 0;
}
