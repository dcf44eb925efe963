#pragma once

#include <geometry_msgs/TwistStamped.h>
#include <ros/ros.h>
#include <std_msgs/Float64.h>

#include "brash_ice_rig/node/topic_names.h"
#include "brash_ice_rig/teleop/teleop_command.h"

namespace brash_ice_rig {

/// Sends what a hand wants to the rig, on the topics for crane and arms. Of a command that was not sent yet only the
/// latest counts.
class CommandPublisher {
 public:
  /// Sends nothing: of no rig.
  CommandPublisher() = default;

  /// @param node  in the rig's namespace
  explicit CommandPublisher(ros::NodeHandle node)
      : velocity_publisher_(node.advertise<geometry_msgs::TwistStamped>(topics::kCraneCommand, 1)),
        fold_publisher_(node.advertise<std_msgs::Float64>(topics::kFoldCommand, 1)) {}

  void send(const TeleopCommand& command) const {
    if (command.velocity_mps && velocity_publisher_) {
      geometry_msgs::TwistStamped message;
      message.header.stamp = ros::Time::now();
      message.twist.linear.x = command.velocity_mps->x();
      message.twist.linear.y = command.velocity_mps->y();
      message.twist.linear.z = command.velocity_mps->z();
      velocity_publisher_.publish(message);
    }
    if (command.fold_target && fold_publisher_) {
      std_msgs::Float64 message;
      message.data = *command.fold_target;
      fold_publisher_.publish(message);
    }
  }

 private:
  ros::Publisher velocity_publisher_, fold_publisher_;
};

}  // namespace brash_ice_rig
