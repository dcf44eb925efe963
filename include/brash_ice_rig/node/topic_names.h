#pragma once

#include <array>

// Every ROS name of the rig, once. All are relative: the launch file puts the node into a namespace, so that several
// rigs run side by side. Types, rates, units and signs are in doc/ros_api.md.
namespace brash_ice_rig {

namespace topics {
constexpr char kWrench[] = "load_cell/wrench";
constexpr char kTrueWrench[] = "ground_truth/wrench";
constexpr char kForceComponents[] = "ground_truth/force_components";
constexpr char kIcePoints[] = "ice/points";
constexpr char kPlugState[] = "plug/state";
constexpr char kCraneCommand[] = "crane/cmd_vel";
constexpr char kCraneCommandOut[] = "crane/cmd_vel_out";
constexpr char kFoldCommand[] = "collector/cmd_fold";
constexpr char kCraneState[] = "crane/state";
constexpr char kSimStatus[] = "sim/status";
constexpr char kScenario[] = "sim/scenario";
constexpr char kMotionFile[] = "sim/motion_file";
constexpr char kCommands[] = "sim/commands";
constexpr char kMeasuredWrench[] = "measured/wrench";
constexpr char kResidual[] = "measured/residual";
constexpr char kJointStates[] = "joint_states";
constexpr char kMarkers[] = "rig/markers";
constexpr char kPullUp[] = "pull_up";  // an action: pull_up/goal, pull_up/feedback...
constexpr char kJoy[] = "joy";         // of the teleoperation, not of the rig
constexpr char kClock[] = "/clock";    // absolute: ROS knows one clock only
}  // namespace topics

namespace services {
constexpr char kPause[] = "pause";  // these seven in the node's private namespace
constexpr char kResume[] = "resume";
constexpr char kReset[] = "reset";
constexpr char kStep[] = "step";
constexpr char kSaveCheckpoint[] = "save_checkpoint";
constexpr char kLoadCheckpoint[] = "load_checkpoint";
constexpr char kLoadScenario[] = "load_scenario";
constexpr char kTare[] = "load_cell/tare";
}  // namespace services

/// Links of the URDF. `map`: z = 0 is the still waterline, x east, y north, z up; the others are parallel to it.
namespace frames {
constexpr char kMap[] = "map";
constexpr char kCarriageX[] = "crane_carriage_x";
constexpr char kCarriageY[] = "crane_carriage_y";
constexpr char kCraneTip[] = "crane_tip";
constexpr char kLoadCell[] = "load_cell";
constexpr char kPole[] = "pole";
constexpr char kCollector[] = "collector";
constexpr char kArmStem[] = "arm_";  // arm_1 .. arm_8, counter-clockwise from x
}  // namespace frames

/// Joints of the URDF, in the order of joint_states; eight arms arm_1_joint .. arm_8_joint follow.
namespace joints {
constexpr char kBoomX[] = "boom_x";
constexpr char kBoomY[] = "boom_y";
constexpr char kHoist[] = "hoist";
constexpr std::array<const char*, 8> kArms = {"arm_1_joint", "arm_2_joint", "arm_3_joint", "arm_4_joint",
                                              "arm_5_joint", "arm_6_joint", "arm_7_joint", "arm_8_joint"};
}  // namespace joints

}  // namespace brash_ice_rig
