// joy_sdl: a joystick as sensor_msgs/Joy on the topic joy, through SDL2. Silent while none is connected.
// doc/ros_api.md. Exit codes: 0 done, 1 SDL failed, 2 bad parameter.

#include <exception>
#include <string>

#include <ros/ros.h>
#include <sensor_msgs/Joy.h>

#include "brash_ice_rig/node/topic_names.h"
#include "brash_ice_rig/teleop/joystick.h"

int main(int argc, char** argv) {
  using namespace brash_ice_rig;
  ros::init(argc, argv, "joy_sdl");
  ros::NodeHandle node, private_node("~");
  const auto index = private_node.param("device", 0);
  const auto layout = private_node.param<std::string>("layout", "gamepad");
  const auto rate_hz = private_node.param("rate_hz", 30.0);
  if (index < 0) {
    ROS_FATAL("device = %d, must be a whole number >= 0", index);
    return 2;
  }
  if (layout != "gamepad" && layout != "raw") {
    ROS_FATAL("layout = \"%s\", must be gamepad or raw", layout.c_str());
    return 2;
  }
  if (!(rate_hz >= 10.0 && rate_hz <= 200.0)) {
    ROS_FATAL("rate_hz = %g, must lie in [10, 200]", rate_hz);
    return 2;
  }
  try {
    Joystick joystick(index, layout == "raw" ? JoystickLayout::kRaw : JoystickLayout::kGamepad);
    ros::Publisher publisher = node.advertise<sensor_msgs::Joy>(topics::kJoy, 1);
    std::string told;
    // Wall time: a joystick lives while the simulation is paused.
    for (ros::WallRate rate(rate_hz); ros::ok(); rate.sleep()) {
      const auto state = joystick.read();
      if (joystick.description() != told) {
        told = joystick.description();
        ROS_INFO("%s", told.c_str());
      }
      if (!state) continue;
      sensor_msgs::Joy message;
      message.header.stamp = ros::Time::now();
      message.axes = state->axes;
      message.buttons = state->buttons;
      publisher.publish(message);
    }
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
  return 0;
}
