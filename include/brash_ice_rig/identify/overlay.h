#pragma once

#include <string>

#include "brash_ice_rig/config/scenario.h"

namespace brash_ice_rig {

/// What makes a scenario out of the default one, as an overlay for scenario files: of rig, ice, water, contact and
/// effects every key that differs, and of the procedure the gap at the start. Not the way of the hoist, nor what
/// belongs to the computation. YAML; loadScenario() takes it over any scenario.
std::string toOverlay(const Scenario& scenario);

}  // namespace brash_ice_rig
