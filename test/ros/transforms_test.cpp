#include <cmath>

#include <sensor_msgs/JointState.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include "brash_ice_rig/CraneState.h"
#include "test_support.h"

namespace brash_ice_rig {
namespace {

// transforms_test.test runs the small rig with a pole of 5 m, and starts it paused.
class Transforms : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(crane_.waitForNew()); }

  bool waitForTransform(const char* child, const std::function<bool(const geometry_msgs::Transform&)>& condition) {
    return waitFor([&] {
      if (!buffer_.canTransform("map", child, ros::Time(0))) return false;
      transform_ = buffer_.lookupTransform("map", child, ros::Time(0)).transform;
      return condition(transform_);
    });
  }

  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_{buffer_};
  Listener<CraneState> crane_{"crane/state"};
  geometry_msgs::Transform transform_;
};

TEST_F(Transforms, LateListenerGetsThemWhilePaused) {
  const CraneState& state = crane_.last();
  EXPECT_TRUE(waitForTransform("crane_tip", [&](const geometry_msgs::Transform& t) {
    return std::abs(t.translation.z - state.position_m.z) < 1e-6;
  }));
}

TEST_F(Transforms, ChainFromMapToCollectorFollowsTheCraneState) {
  const CraneState& state = crane_.last();
  EXPECT_NEAR(state.position_m.z - state.hoist_position_m, 5.0, 1e-9);
  for (const char* frame : {"load_cell", "pole"}) {
    EXPECT_TRUE(waitForTransform(frame, [&](const geometry_msgs::Transform& t) {
      return std::abs(t.translation.z - state.position_m.z) < 1e-6;
    })) << frame;
  }
  EXPECT_TRUE(waitForTransform("collector", [&](const geometry_msgs::Transform& t) {
    return std::abs(t.translation.z - state.hoist_position_m) < 1e-6;
  })) << transform_;
}

TEST_F(Transforms, ArmsPointOutwardsAndUpByTheArmAngle) {
  const double angle_rad = crane_.last().arm_angle_rad;
  EXPECT_NEAR(angle_rad, std::atan2(0.3, 0.7), 1e-9);
  for (int arm = 0; arm < 8; ++arm) {
    const std::string frame = "arm_" + std::to_string(arm + 1);
    ASSERT_TRUE(waitForTransform(frame.c_str(), [](const geometry_msgs::Transform&) { return true; }));
    // The arm's x axis in map.
    const auto& q = transform_.rotation;
    EXPECT_NEAR(1.0 - 2.0 * (q.y * q.y + q.z * q.z), std::cos(angle_rad) * std::cos(arm * M_PI / 4.0), 1e-6) << frame;
    EXPECT_NEAR(2.0 * (q.x * q.y + q.z * q.w), std::cos(angle_rad) * std::sin(arm * M_PI / 4.0), 1e-6) << frame;
    EXPECT_NEAR(2.0 * (q.x * q.z - q.y * q.w), std::sin(angle_rad), 1e-6) << frame;
  }
}

TEST_F(Transforms, FollowTheHoist) {
  ASSERT_TRUE(waitForTransform("collector", [](const geometry_msgs::Transform&) { return true; }));
  const double before_m = transform_.translation.z;
  ASSERT_TRUE(callTrigger("rig_node/resume").success);
  EXPECT_TRUE(waitForTransform("collector",
                               [&](const geometry_msgs::Transform& t) { return t.translation.z > before_m + 0.2; }));
}

TEST_F(Transforms, JointStatesNameEveryMovingJoint) {
  Listener<sensor_msgs::JointState> joints("joint_states");
  ASSERT_TRUE(joints.waitForNew());
  const sensor_msgs::JointState& state = joints.last();
  EXPECT_EQ(state.name,
            (std::vector<std::string>{"boom_x", "boom_y", "hoist", "arm_1_joint", "arm_2_joint", "arm_3_joint",
                                      "arm_4_joint", "arm_5_joint", "arm_6_joint", "arm_7_joint", "arm_8_joint"}));
  EXPECT_EQ(state.position.size(), state.name.size());
  EXPECT_EQ(state.velocity.size(), state.name.size());
  EXPECT_EQ(state.effort.size(), state.name.size());
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "transforms_test");
}
