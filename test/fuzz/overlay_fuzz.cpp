// A scenario file, two overlays and settings: what comes out can be told as an overlay again.

#include <sstream>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/identify/overlay.h"
#include "fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace brash_ice_rig;
  static const FuzzDirectory kDirectory;
  const std::vector<std::string> files = filesOf(textOf(data, size), 4);
  ScenarioSources sources;
  sources.file = kDirectory.write("scenario.yaml", files[0]);
  if (!files[1].empty()) sources.overlays.push_back(kDirectory.write("first.yaml", files[1]));
  if (!files[2].empty()) sources.overlays.push_back(kDirectory.write("second.yaml", files[2]));
  std::istringstream lines(files[3]);
  for (std::string line; std::getline(lines, line);) sources.settings.push_back(line);
  std::string overlay;
  try {
    overlay = toOverlay(loadScenario(sources));
  } catch (const ConfigError&) {
    return 0;
  }
  if (overlay.empty()) return 0;
  try {
    ScenarioSources over_default;
    over_default.overlays = {kDirectory.write("made.yaml", overlay)};
    require(toOverlay(loadScenario(over_default)) == overlay, "an overlay says all that it was made of");
  } catch (const ConfigError& error) {
    // Its values need not fit the default field, but each must be understood.
    const std::string what = error.what();
    require(what.find("unknown key") == std::string::npos && what.find("not valid YAML") == std::string::npos &&
                what.find("must be a number") == std::string::npos,
            error.what());
  }
  return 0;
}
