#pragma once

#include <string>

#include "brash_ice_rig/config/scenario.h"

namespace brash_ice_rig {

/// URDF of crane, load cell, pole and collector with the scenario's dimensions.
///
/// Chain: map -boom_x-> -boom_y-> -hoist-> crane_tip -> load_cell -> pole -> collector -arm_N_joint-> arm_N.
/// Joint values: boom_x, boom_y are the crane tip's position in map, m; hoist is the height of the hub over the still
/// waterline, m (hoist_position_m of force.csv); arm_N_joint is the arm's angle over the horizontal, rad.
/// @param frame_prefix  put before every link name, e.g. "rig_2/"; joint names stay
std::string makeRigUrdf(const Scenario& scenario, const std::string& frame_prefix);

}  // namespace brash_ice_rig
