// joy_teleop: from sensor_msgs/Joy to commands for crane and fold, as a file of config/teleop says. doc/ros_api.md.
// Exit codes: 0 done, 2 bad input.

#include <string>

#include <geometry_msgs/TwistStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/Joy.h>
#include <std_msgs/Float64.h>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/node/topic_names.h"
#include "brash_ice_rig/teleop/joy_mapping.h"

int main(int argc, char** argv) {
  using namespace brash_ice_rig;
  ros::init(argc, argv, "joy_teleop");
  ros::NodeHandle node, private_node("~");
  JoyConfig config;
  try {
    const auto path = private_node.param<std::string>("config", "");
    if (path.empty()) throw ConfigError("config", "", "must name a file such as config/teleop/gamepad.yaml");
    config = readJoyConfig(path);
  } catch (const ConfigError& error) {
    ROS_FATAL("%s", error.what());
    return 2;
  }

  ros::Publisher velocity_publisher = node.advertise<geometry_msgs::TwistStamped>(topics::kCraneCommand, 1);
  ros::Publisher fold_publisher = node.advertise<std_msgs::Float64>(topics::kFoldCommand, 1);
  const auto send = [&](const TeleopCommand& command) {
    if (command.velocity_mps) {
      geometry_msgs::TwistStamped message;
      message.header.stamp = ros::Time::now();
      message.twist.linear.x = command.velocity_mps->x();
      message.twist.linear.y = command.velocity_mps->y();
      message.twist.linear.z = command.velocity_mps->z();
      velocity_publisher.publish(message);
    }
    if (command.fold_target) {
      std_msgs::Float64 message;
      message.data = *command.fold_target;
      fold_publisher.publish(message);
    }
  };

  // Wall time throughout: the hand on the stick knows no other.
  JoyMapping mapping(config);
  const ros::Subscriber joy_subscriber =
      node.subscribe<sensor_msgs::Joy>(topics::kJoy, 1, [&](const sensor_msgs::Joy::ConstPtr& joy) {
        const std::string misfit = mapping.misfit(joy->axes.size(), joy->buttons.size());
        if (!misfit.empty()) ROS_WARN_STREAM_THROTTLE(5.0, misfit);
        send(mapping.read(joy->axes, joy->buttons, ros::SteadyTime::now().toSec()));
      });
  const ros::SteadyTimer timer = node.createSteadyTimer(ros::WallDuration(0.05), [&](const ros::SteadyTimerEvent&) {
    send(mapping.update(ros::SteadyTime::now().toSec()));
  });
  ros::spin();
  return 0;
}
