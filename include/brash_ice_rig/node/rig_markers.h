#pragma once

#include <array>

#include <visualization_msgs/MarkerArray.h>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/node/message_conversion.h"
#include "brash_ice_rig/simulation/snapshot.h"

// What rviz shows besides the particles and the URDF.
namespace brash_ice_rig {

/// Length of force arrow and bars per force, unless told otherwise: 1 m for 10 kN.
constexpr double kMarkerMetresPerNewton = 1.0e-4;

/// A part of the load cell's true tension, for a bar and a line of text.
struct ForcePart {
  const char* label;
  double force_n;  ///< > 0 when it pulls down on the crane
  std::array<float, 3> color_rgb;
};

/// The tension as the sum of five parts: rig in water (weight - buoyancy), raised ice in water (the same), drag of the
/// raised ice, friction and cohesion of the ice around it, inertia of the rig. Their sum is snapshot.tension_n.
std::array<ForcePart, 5> splitTension(const Snapshot& snapshot);

/// Namespaces of the markers: water, net, force, components (bars and lines of text), text, plug_waterline, plug_top,
/// hole. metres_per_newton is the length of arrow and bars per force. A part that is not there now, such as the plug
/// before the lift, is deleted.
visualization_msgs::MarkerArray toMarkers(const Stamp& stamp, const Scenario& scenario, const Snapshot& snapshot,
                                          const PlugOutline& plug, double metres_per_newton = kMarkerMetresPerNewton);

}  // namespace brash_ice_rig
