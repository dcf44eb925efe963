#pragma once

#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/simulation/snapshot.h"

namespace brash_ice_rig {

/// Raised: more than one spacing over the original site.
inline bool isRaised(const Eigen::Vector3d& site_m, const Eigen::Vector3d& position_m, double spacing_m) {
  return position_m.z() - site_m.z() > spacing_m;
}

/// Shape of the raised ice and of the hole it left.
/// @param site_m      original positions, one per particle
/// @param position_m  present positions, in the same order
/// A hole site counts as refilled when a particle that is not raised lies within half a spacing of it.
PlugSummary computePlug(const std::vector<Eigen::Vector3d>& site_m, const std::vector<Eigen::Vector3d>& position_m,
                        double spacing_m, double particle_mass_kg);

}  // namespace brash_ice_rig
