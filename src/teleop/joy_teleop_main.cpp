// joy_teleop: from sensor_msgs/Joy to commands for crane and fold, as a file of config/teleop says. doc/ros_api.md.
// Exit codes: 0 done, 2 bad input.

#include <string>

#include <ros/ros.h>
#include <sensor_msgs/Joy.h>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/node/topic_names.h"
#include "brash_ice_rig/teleop/command_publisher.h"
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

  const CommandPublisher commands(node);

  // Wall time throughout: the hand on the stick knows no other.
  JoyMapping mapping(config);
  const ros::Subscriber joy_subscriber =
      node.subscribe<sensor_msgs::Joy>(topics::kJoy, 1, [&](const sensor_msgs::Joy::ConstPtr& joy) {
        const std::string misfit = mapping.misfit(joy->axes.size(), joy->buttons.size());
        if (!misfit.empty()) ROS_WARN_STREAM_THROTTLE(5.0, misfit);
        commands.send(mapping.read(joy->axes, joy->buttons, ros::SteadyTime::now().toSec()));
      });
  const ros::SteadyTimer timer = node.createSteadyTimer(ros::WallDuration(0.05), [&](const ros::SteadyTimerEvent&) {
    commands.send(mapping.update(ros::SteadyTime::now().toSec()));
  });
  ros::spin();
  return 0;
}
