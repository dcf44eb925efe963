// rig_node: the pull-up rig as a ROS node. Topics, services and parameters: doc/ros_api.md.
// Exit codes: 0 done, 1 run failed, 2 bad input.

#include <malloc.h>

#include <exception>
#include <memory>

#include <ros/ros.h>

#include "brash_ice_rig/node/loopback.h"
#include "brash_ice_rig/node/master_watch.h"
#include "brash_ice_rig/node/node_options.h"
#include "brash_ice_rig/node/rig_node.h"
#include "brash_ice_rig/simulation/waiting_threads.h"

int main(int argc, char** argv) {
  using namespace brash_ice_rig;
  letWaitingThreadsSleep(argv);
  // What an autosave needs for a moment, the more the longer a run has been, goes back to the system: otherwise the
  // heap keeps up to 64 MB of it.
  mallopt(M_MMAP_THRESHOLD, 4 << 20);
  ros::init(argc, argv, "rig_node");
  try {
    ros::NodeHandle node, private_node("~");
    fenceToLoopback();
    std::unique_ptr<RigNode> rig;
    try {
      rig = std::make_unique<RigNode>(readNodeOptions(private_node), node, private_node);
    } catch (const ConfigError& error) {
      ROS_FATAL("%s", error.what());
      return 2;
    } catch (const OutputError& error) {
      ROS_FATAL("%s", error.what());
      return 2;
    }
    // Four threads: a command must get through while a service, a change of settings and a goal wait for their answers.
    ros::AsyncSpinner spinner(4);
    spinner.start();
    const MasterWatch master(node, {"/use_sim_time", node.resolveName("robot_description")});
    const int code = rig->run();
    spinner.stop();
    return code;
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
}
