#include "brash_ice_rig/ice/ice_scaling.h"

#include <gtest/gtest.h>

// paper_tables_test.cpp compares eqs. 10 and 13 to 15 with Tables 6 and 7.

namespace brash_ice_rig {
namespace {

TEST(IceScaling, ElasticModulusFollowsEq5) {
  EXPECT_NEAR(computeBrashElasticModulus(4.0e9, 0.36), 1.6e9, 1.0);  // D-1: sqrt(0.36) = 0.6
  EXPECT_NEAR(computeBrashElasticModulus(4.0e9, 0.60), 901.61e6, 0.01e6);
  EXPECT_EQ(computeBrashElasticModulus(4.0e9, 0.0), 4.0e9);
}

TEST(IceScaling, ModuliFollowEq6) {
  const ElasticModuli moduli = computeElasticModuli(2.6e9, 0.3);
  EXPECT_EQ(moduli.elastic_pa, 2.6e9);
  EXPECT_NEAR(moduli.shear_pa, 1.0e9, 1.0);
  EXPECT_NEAR(moduli.bulk_pa, 2.6e9 / 1.2, 1.0);
}

TEST(IceScaling, BulkDensityCountsTheIceOnly) {
  EXPECT_NEAR(computeBulkDensity(900.0, 0.6), 360.0, 1e-9);
  EXPECT_NEAR(computeBulkDensity(900.0, 0.36), 576.0, 1e-9);
}

TEST(IceScaling, WaveSpeedOfB1) {
  const ElasticModuli moduli = computeElasticModuli(computeBrashElasticModulus(4.0e9, 0.6), 0.3);
  EXPECT_NEAR(computeWaveSpeed(moduli, 360.0), 1836.0, 1.0);
  // With nu = 0 the wave modulus is E itself.
  EXPECT_NEAR(computeWaveSpeed(computeElasticModuli(9.0e6, 0.0), 1000.0), 94.868, 1e-3);
}

TEST(IceScaling, FractureOfSolidIceIsThatOfTheParent) {
  // Eqs. 13 to 15 without voids; paper_tables_test.cpp has the brash ice of Table 7.
  EXPECT_EQ(computeCompressiveFractureEnergy(20.0, 0.0), 20.0);
  EXPECT_EQ(computeFractureToughness(1.0e5, 0.0), 1.0e5);
  EXPECT_NEAR(computeTensileFractureEnergy(1.0e5, 4.0e9, 0.3), 2.275, 1e-12);  // 0.91 x 1e10 / 4e9
}

TEST(IceScaling, ShearSurfaceMeetsMohrCoulombInTriaxialCompression) {
  // Mohr-Coulomb with c = 1, phi = 30°: unconfined strength 2 c cos(phi) / (1 - sin(phi)) = 2 sqrt(3).
  const ShearSurface surface = computeShearSurface(1.0, 30.0);
  const double q = 2.0 * 1.7320508075688772;
  EXPECT_NEAR(q / 1.7320508075688772, surface.constant_pa + surface.slope * q, 1e-12);
}

}  // namespace
}  // namespace brash_ice_rig
