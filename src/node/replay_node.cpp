// replay_node: publishes a measured force at the times of the simulated test, so that it stands beside the simulated
// one under the same stamps (doc/ros_api.md, section Replay). Exit codes: 0 done, 2 bad input.

#include <exception>
#include <optional>
#include <string>

#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>

#include "brash_ice_rig/ForceComponents.h"
#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/identify/measured_force.h"
#include "brash_ice_rig/node/loopback.h"
#include "brash_ice_rig/node/parameter_reader.h"
#include "brash_ice_rig/node/topic_names.h"

int main(int argc, char** argv) {
  using namespace brash_ice_rig;
  ros::init(argc, argv, "replay_node");
  try {
    ros::NodeHandle node, private_node("~");
    fenceToLoopback();
    std::string file, frame_prefix;
    ParameterReader reader(private_node);
    reader.read("measured", file);
    reader.read("frame_prefix", frame_prefix);
    reader.refuseUnknown();
    if (file.empty()) {
      throw ConfigError(private_node.resolveName("measured"), "\"\"", "must name the measured.csv of a replay");
    }
    const MeasuredForce measured = MeasuredForce::read(file);
    ROS_INFO("measured force from %.2f to %.2f s of the test", measured.start(), measured.end());

    const ros::Publisher publisher = node.advertise<geometry_msgs::WrenchStamped>(topics::kMeasuredWrench, 1000);
    const ros::Subscriber subscriber = node.subscribe<ForceComponents>(
        topics::kForceComponents, 1000,
        boost::function<void(const ForceComponents::ConstPtr&)>([&](const ForceComponents::ConstPtr& simulated) {
          const std::optional<double> force_n = measured.at(simulated->time_s);
          if (!force_n) return;
          geometry_msgs::WrenchStamped wrench;
          wrench.header.stamp = simulated->header.stamp;
          wrench.header.frame_id = frame_prefix + frames::kLoadCell;
          wrench.wrench.force.z = *force_n;
          publisher.publish(wrench);
        }));
    ros::spin();
    return 0;
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 2;
  }
}
