// A scenario: anything is either refused by name, or becomes a scenario that is written and read back to itself.

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/scenario_reader.h"
#include "fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace brash_ice_rig;
  Scenario scenario;
  try {
    scenario = parseScenario(textOf(data, size), "input");
  } catch (const ConfigError& error) {
    require(!error.rule().empty(), "an error names its rule");
    return 0;
  }
  const std::string yaml = toYaml(scenario);
  try {
    require(toYaml(parseScenario(yaml, "output")) == yaml, "a scenario is read back as it was written");
  } catch (const ConfigError& error) {
    require(false, error.what());
  }
  try {
    scenario.validate();
  } catch (const ConfigError&) {
  }
  return 0;
}
