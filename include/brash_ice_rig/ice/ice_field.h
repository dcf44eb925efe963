#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/config/scenario.h"

namespace brash_ice_rig {

/// The undisturbed field: a box of particles, centred on x = y = 0, its bottom at z = -draft.
struct IceField {
  std::vector<Eigen::Vector3d> position_m;  ///< one per particle, frame map; particles of one column follow each other
  std::vector<bool> fixed;                  ///< the outermost columns, held in place (section 4 of the paper)
  std::size_t count_x = 0, count_y = 0, count_z = 0;
};

/// @param draft_m  depth of the bottom under the waterline, m, >= 0
/// Jitter moves a particle by up to jitter_ratio spacings along each axis; the same seed gives the same field.
IceField makeIceField(const FieldConfig& config, double draft_m);

}  // namespace brash_ice_rig
