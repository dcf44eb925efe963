#pragma once

#include <string>
#include <utility>
#include <vector>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/scenario.h"

namespace brash_ice_rig {

/// Where a scenario comes from; later entries win over earlier ones: file, overlays in order, settings in order.
struct ScenarioSources {
  std::string file;                   ///< path of a scenario YAML; empty: the defaults
  std::vector<std::string> overlays;  ///< paths of YAML files that hold only the changed keys
  std::vector<std::string> settings;  ///< `section.key=value`
};

/// Reads, composes and validates a scenario.
/// @throws ConfigError on an unreadable or empty file, a YAML syntax error, an unknown key (names the nearest known
///   one), a wrong type, a value out of range, or two overlays that give one key different values
Scenario loadScenario(const ScenarioSources& sources);

/// Reads a scenario that is in memory. Each value is in its range, but validate() is left to the caller: it may look at
/// files that the scenario names.
/// @param where  what to call its source in messages
/// @throws ConfigError as loadScenario() does
Scenario parseScenario(const std::string& yaml, const std::string& where);

/// The whole scenario as YAML, every key with its value; loadScenario reads it back to an equal scenario.
std::string toYaml(const Scenario& scenario);

/// Every key, as `section.key`, with its value as in toYaml() but without quotes; empty: not set. In the order of
/// visit(), the same for all scenarios.
std::vector<std::pair<std::string, std::string>> keyValues(const Scenario& scenario);

}  // namespace brash_ice_rig
