#pragma once

namespace brash_ice_rig {

/// Where ROS_HOSTNAME or ROS_IP says that this node is for this computer only, roscpp binds its sockets for topics and
/// services to the loopback interface, but not that of its XML-RPC server, by which anybody on the network could end
/// the node. This binds that one, too. After the first ros::NodeHandle.
/// @return whether the node is fenced: false where it is meant to be reached from elsewhere, or the system refuses
bool fenceToLoopback();

}  // namespace brash_ice_rig
