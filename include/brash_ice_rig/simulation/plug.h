#pragma once

#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/simulation/snapshot.h"

namespace brash_ice_rig {

/// Raised: more than one spacing over the original site, and over the hub. Ice that floats up behind the collector,
/// into the hole, is not raised by it.
inline bool isRaised(const Eigen::Vector3d& site_m, const Eigen::Vector3d& position_m, double spacing_m,
                     double hub_height_m) {
  return position_m.z() - site_m.z() > spacing_m && position_m.z() > hub_height_m;
}

/// Shape of the raised ice, of the hole it left, and of the bulge at the ice's surface (the paper's Fig. 15 a).
/// @param site_m      original positions, one per particle
/// @param position_m  present positions, in the same order
/// @param hub_height_m  height of the collector's hub over the still waterline
/// The axis is the vertical through the origin; the top layer are the sites less than 0.8 spacings below the highest:
/// with the largest jitter, 0.3 spacings, a layer is 0.6 thick, and the one below begins a whole spacing lower.
/// A hole site counts as refilled when a particle that is not raised lies within half a spacing of it.
PlugSummary computePlug(const std::vector<Eigen::Vector3d>& site_m, const std::vector<Eigen::Vector3d>& position_m,
                        double spacing_m, double particle_mass_kg, double hub_height_m);

/// Outlines of the raised ice and of its hole for display; same arguments as computePlug(). Each outline is the convex
/// hull of the particles' sections, discs of half a spacing drawn as polygons of twelve corners. Sections and hole are
/// those of PlugSummary: within half a spacing of z = 0, less than a spacing below the highest raised particle, and the
/// sites of the bottom layer from which particles were raised.
PlugOutline computePlugOutline(const std::vector<Eigen::Vector3d>& site_m,
                               const std::vector<Eigen::Vector3d>& position_m, double spacing_m, double hub_height_m);

}  // namespace brash_ice_rig
