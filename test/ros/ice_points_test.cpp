#include <cstring>

#include <sensor_msgs/PointCloud2.h>

#include "test_support.h"

namespace brash_ice_rig {
namespace {

TEST(IcePoints, EightFloatsPerParticleInTheDocumentedOrder) {
  Listener<sensor_msgs::PointCloud2> clouds("ice/points");
  Listener<SimStatus> status("sim/status");
  ASSERT_TRUE(clouds.waitForNew());
  ASSERT_TRUE(status.waitForNew());
  const sensor_msgs::PointCloud2& cloud = clouds.last();
  const std::vector<std::string> names = {"x", "y", "z", "speed", "pressure", "plastic_strain", "damage", "submerged"};
  ASSERT_EQ(cloud.fields.size(), names.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    EXPECT_EQ(cloud.fields[i].name, names[i]);
    EXPECT_EQ(cloud.fields[i].offset, 4 * i);
    EXPECT_EQ(cloud.fields[i].datatype, sensor_msgs::PointField::FLOAT32);
    EXPECT_EQ(cloud.fields[i].count, 1u);
  }
  EXPECT_EQ(cloud.header.frame_id, "map");
  EXPECT_EQ(cloud.point_step, 32u);
  EXPECT_EQ(cloud.height, 1u);
  EXPECT_EQ(cloud.width, status.last().particle_count);
  EXPECT_EQ(cloud.width, 16u * 16u * 4u);
  EXPECT_EQ(cloud.data.size(), 32u * cloud.width);
  EXPECT_TRUE(cloud.is_dense);
}

TEST(IcePoints, ParticlesFloatInTheField) {
  Listener<sensor_msgs::PointCloud2> clouds("ice/points");
  ASSERT_TRUE(clouds.waitForNew());
  const sensor_msgs::PointCloud2& cloud = clouds.last();
  double mean_z = 0.0;
  for (std::size_t i = 0; i < cloud.width; ++i) {
    float point[8];
    std::memcpy(point, &cloud.data[i * cloud.point_step], sizeof point);
    ASSERT_LT(std::abs(point[0]), 2.7F);
    ASSERT_LT(std::abs(point[1]), 2.7F);
    ASSERT_GE(point[7], 0.0F);
    ASSERT_LE(point[7], 1.0F);
    if (point[2] < -0.3F) ASSERT_EQ(point[7], 1.0F) << "deep particles are wholly under water";
    mean_z += static_cast<double>(point[2]) / cloud.width;
  }
  EXPECT_NEAR(mean_z, 0.6 - 1.08, 0.15) << "a 1.2 m field of 900 kg/m3 floats 1.08 m deep";
}

TEST(IcePoints, ComeTenTimesPerSimulatedSecond) {
  Listener<sensor_msgs::PointCloud2> clouds("ice/points");
  ASSERT_TRUE(waitFor([&] { return clouds.messages.size() >= 12; }));
  for (std::size_t i = 1; i < clouds.messages.size(); ++i) {
    EXPECT_NEAR((clouds.messages[i].header.stamp - clouds.messages[i - 1].header.stamp).toSec(), 0.1, 1e-6);
  }
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "ice_points_test");
}
