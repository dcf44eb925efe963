#pragma once

#include <string>
#include <vector>

#include <ros/ros.h>

namespace brash_ice_rig {

/// ROS 1 does not tell a node that its master has gone, and another one that takes its place does not know the node.
/// This watch says both in the log, and registers the node anew, as it was before, with a master that forgot it:
/// publishers, subscribers, services, and the parameters that others need of a rig. Connections that stand do not need
/// a master and are not touched.
class MasterWatch {
 public:
  /// Looks at the master every two seconds of wall time, by a callback of the node's queue.
  /// @param parameters  full names of those that are set anew if they are missing
  MasterWatch(ros::NodeHandle& node, std::vector<std::string> parameters);

 private:
  struct Registration {
    std::string name;
    std::string what;  ///< a topic's type, or a service's URI
  };

  void look();
  void remember();
  void registerAnew();

  std::vector<std::string> parameters_;
  std::vector<Registration> published_, subscribed_, services_;
  std::vector<std::pair<std::string, XmlRpc::XmlRpcValue>> values_;
  std::string own_uri_;
  bool lost_ = false;
  ros::WallTimer timer_;
};

}  // namespace brash_ice_rig
