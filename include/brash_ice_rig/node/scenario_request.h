#pragma once

#include <string>

#include "brash_ice_rig/LoadScenario.h"
#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/simulation/snapshot.h"

namespace brash_ice_rig {

/// The files that a request for another scenario names, which must lie below one directory, whatever links and dots
/// are in their paths: whoever reaches the service must not read elsewhere.
/// @param scenario_dir  not empty
/// @param present  what the node has now; its scenario file stands where the request names none
/// @throws ConfigError naming the field of the request, value and rule: a file that is missing or elsewhere; a setting
///   of a key that names a file (a scenario below the directory may)
ScenarioSources resolveScenarioRequest(const LoadScenarioRequest& request, const std::string& scenario_dir,
                                       const ScenarioSources& present);

/// Why the world must not be replaced now: the rig moves, by script or by hand. Empty: it may.
std::string reasonAgainstLoad(const Snapshot& snapshot);

}  // namespace brash_ice_rig
