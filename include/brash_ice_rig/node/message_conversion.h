#pragma once

#include <string>
#include <vector>

#include <geometry_msgs/Point.h>
#include <geometry_msgs/TwistStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/time.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/PointCloud2.h>

#include "brash_ice_rig/CraneState.h"
#include "brash_ice_rig/ForceComponents.h"
#include "brash_ice_rig/PlugState.h"
#include "brash_ice_rig/SimStatus.h"
#include "brash_ice_rig/TakenCommand.h"
#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/node/live_options.h"
#include "brash_ice_rig/rig/rig_commands.h"
#include "brash_ice_rig/simulation/snapshot.h"

// From the core's structs to messages. Units and signs are those of the core; only headers are added.
namespace brash_ice_rig {

/// Stamp and prefix that all messages of one instant share.
struct Stamp {
  ros::Time time;
  std::string frame_prefix;

  std_msgs::Header header(const char* frame) const;
};

geometry_msgs::Point toPoint(const Eigen::Vector3d& position_m);

/// Force that the crane exerts on the rig at the load cell, N, axes of the frame load_cell: z > 0 when the rig pulls
/// down on the crane. The cell measures no torque: zero.
geometry_msgs::WrenchStamped toWrench(const Stamp& stamp, const Eigen::Vector3d& force_n);

ForceComponents toForceComponents(const Stamp& stamp, const Snapshot& snapshot);
PlugState toPlugState(const Stamp& stamp, double time_s, const PlugSummary& plug);
CraneState toCraneState(const Stamp& stamp, const Snapshot& snapshot);

/// @param index  of the command within its run
TakenCommand toTakenCommand(const Stamp& stamp, const RigCommand& command, std::uint32_t index);

/// Velocity of the crane tip after limits, frame crane_tip, whose axes are those of map.
geometry_msgs::TwistStamped toCommandOut(const Stamp& stamp, const RigState& rig);

/// Values of the URDF's moving joints (rig_urdf.h). Effort of the hoist: tension, N.
sensor_msgs::JointState toJointState(const Stamp& stamp, const Snapshot& snapshot);

/// Unpadded points of eight float32: x y z speed pressure plastic_strain damage submerged; frame map, SI.
sensor_msgs::PointCloud2 toPointCloud(const Stamp& stamp, const ParticleCloud& particles, const LiveOptions& options);

/// Fills flags, flag_names and remedies.
/// @param breakdown  of the simulation, behind the remedy of a frozen world
void setFlags(StatusFlags flags, const std::string& breakdown, SimStatus& status);

}  // namespace brash_ice_rig
