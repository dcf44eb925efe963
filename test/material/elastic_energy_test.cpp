#include <gtest/gtest.h>

#include "../sph/elastic_material.h"

namespace brash_ice_rig {
namespace {

// Timoshenko and Goodier, Theory of Elasticity, strain energy: sigma²/2E in tension, tau²/2G in shear, p²/2K under
// pressure.
TEST(ElasticEnergy, IsTheTextbookOnesOfTensionShearAndPressure) {
  const double bulk = 7.0e5, shear = 3.0e5;
  const ElasticMaterial material(bulk, shear);
  const double young = 9.0 * bulk * shear / (3.0 * bulk + shear);
  const std::vector<float> state(1, 0.0f);
  EXPECT_NEAR(material.elasticEnergyDensity({0.0f, 1500.0f, 0.0f, 0.0f, 0.0f, 0.0f}, state),
              1500.0 * 1500.0 / (2.0 * young), 1e-9);
  EXPECT_NEAR(material.elasticEnergyDensity({0.0f, 0.0f, 0.0f, 0.0f, -800.0f, 0.0f}, state),
              800.0 * 800.0 / (2.0 * shear), 1e-9);
  EXPECT_NEAR(material.elasticEnergyDensity({-900.0f, -900.0f, -900.0f, 0.0f, 0.0f, 0.0f}, state),
              900.0 * 900.0 / (2.0 * bulk), 1e-9);
}

}  // namespace
}  // namespace brash_ice_rig
