#include "brash_ice_rig/ice/ice_field.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

TEST(IceField, PapersTable3Gives50By50By4Particles) {
  const IceField field = makeIceField(FieldConfig(), 1.08);
  EXPECT_EQ(field.count_x, 50u);
  EXPECT_EQ(field.count_y, 50u);
  EXPECT_EQ(field.count_z, 4u);
  EXPECT_EQ(field.position_m.size(), 10000u);
}

TEST(IceField, ReachesFromDraftToFreeboardAndIsCentred) {
  const IceField field = makeIceField(FieldConfig(), 1.08);
  Eigen::Vector3d low = field.position_m.front(), high = low;
  for (const auto& p : field.position_m) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  EXPECT_NEAR(low.z() - 0.15, -1.08, 1e-12);
  EXPECT_NEAR(high.z() + 0.15, 0.12, 1e-12);
  EXPECT_NEAR(low.x(), -7.35, 1e-12);
  EXPECT_NEAR((low + high).head<2>().norm(), 0.0, 1e-12);
}

TEST(IceField, OutermostColumnsAreFixed) {
  const IceField field = makeIceField(FieldConfig(), 1.08);
  // 50 x 50 columns less the inner 48 x 48, four particles each.
  EXPECT_EQ(std::count(field.fixed.begin(), field.fixed.end(), true), (2500 - 2304) * 4);
}

TEST(IceField, JitterIsBoundedSeededAndOffByDefault) {
  FieldConfig config;
  const IceField regular = makeIceField(config, 1.08);
  config.jitter_ratio = 0.2;
  const IceField one = makeIceField(config, 1.08), again = makeIceField(config, 1.08);
  config.seed = 2;
  const IceField other = makeIceField(config, 1.08);
  double largest = 0.0;
  for (std::size_t i = 0; i < regular.position_m.size(); ++i) {
    largest = std::max(largest, (one.position_m[i] - regular.position_m[i]).cwiseAbs().maxCoeff());
  }
  EXPECT_LE(largest, 0.2 * 0.3 + 1e-12);
  EXPECT_GT(largest, 0.19 * 0.3);
  EXPECT_EQ(one.position_m, again.position_m);
  EXPECT_NE(one.position_m, other.position_m);
}

}  // namespace
}  // namespace brash_ice_rig
