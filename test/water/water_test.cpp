#include "brash_ice_rig/water/water.h"

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

// B-1: ice 900 kg/m³, water 1000 kg/m³, V_f = 0.6, spacing 0.3 m.
ParticleInWater particle() {
  return ParticleInWater(WaterConfig(), IceConfig(), 0.3);
}

TEST(Buoyancy, SubmergedShareFallsLinearlyAcrossTheWaterlineAsInEq2) {
  EXPECT_FLOAT_EQ(particle().submerged(-0.2f), 1.0f);
  EXPECT_NEAR(particle().submerged(-0.15f), 1.0f, 1e-6f);
  EXPECT_FLOAT_EQ(particle().submerged(0.0f), 0.5f);
  EXPECT_NEAR(particle().submerged(0.075f), 0.25f, 1e-6f);
  EXPECT_EQ(particle().submerged(0.2f), 0.0f);
}

TEST(Buoyancy, ActsUpAndExceedsTheWeightByTheDensityRatio) {
  // 0.027 m³ x 0.4 x 9.81 m/s² = 0.105948 m⁴/s²; times 900 and 1000 kg/m³.
  EXPECT_NEAR(particle().weight(), 95.3532f, 1e-3f);
  EXPECT_NEAR(particle().buoyancy(1.0f), 105.948f, 1e-3f);
  EXPECT_NEAR(particle().force(-1.0f, Eigen::Vector4f::Zero()).z(), 10.5948f, 1e-3f);
  EXPECT_NEAR(particle().force(+1.0f, Eigen::Vector4f::Zero()).z(), -95.3532f, 1e-3f);
}

TEST(Buoyancy, AColumnOfTheFieldFloatsAtNineTenths) {
  float sum = 0.0f;
  for (int layer = 0; layer < 4; ++layer) {
    sum += particle().force(-1.08f + 0.3f * (static_cast<float>(layer) + 0.5f), Eigen::Vector4f::Zero()).z();
  }
  EXPECT_NEAR(sum, 0.0f, 1e-3f);
}

TEST(WaterPotential, OfAPushedUnderCubeIsArchimedesMeanForceTimesItsHeight) {
  // From just clear of the water to just under it the buoyancy grows linearly to 105.948 N, over 0.3 m.
  EXPECT_NEAR(particle().buoyancyPotential(-0.15) - particle().buoyancyPotential(0.15), 0.5 * 105.948 * 0.3, 1e-5);
  EXPECT_EQ(particle().buoyancyPotential(2.0), 0.0);
  EXPECT_NEAR(particle().buoyancyPotential(-2.15) - particle().buoyancyPotential(-0.15), 105.948 * 2.0, 1e-4);
  EXPECT_NEAR(particle().weightPotential(3.0), 95.3532 * 3.0, 1e-3);
}

TEST(WaterPotential, FallsByTheForceTimesTheWay) {
  const double step = 1e-4;
  for (const double height : {-0.4, -0.14, -0.05, 0.0, 0.1, 0.149, 0.3}) {
    const double slope = (particle().buoyancyPotential(height + step) + particle().weightPotential(height + step) -
                          particle().buoyancyPotential(height - step) - particle().weightPotential(height - step)) /
                         (2.0 * step);
    const float force = particle().force(static_cast<float>(height), Eigen::Vector4f::Zero()).z();
    EXPECT_NEAR(-slope, static_cast<double>(force), 2e-3) << height;
  }
}

TEST(Drag, OpposesTheVelocityWithEq3sMagnitude) {
  // 1/2 x 1.05 x 1000 x 0.4 x 0.09 m² x (0.2 m/s)² = 0.756 N
  const Eigen::Vector4f up(0.0f, 0.0f, 0.2f, 0.0f);
  EXPECT_NEAR(particle().drag(up, 1.0f).z(), -0.756f, 1e-4f);
  EXPECT_NEAR(particle().drag(-up, 1.0f).z(), 0.756f, 1e-4f);
  EXPECT_NEAR(particle().drag(up, 0.5f).z(), -0.378f, 1e-4f);
}

TEST(Drag, IsNoneInAir) {
  EXPECT_EQ(particle().drag(Eigen::Vector4f(1.0f, 2.0f, 3.0f, 0.0f), 0.0f).norm(), 0.0f);
}

}  // namespace
}  // namespace brash_ice_rig
