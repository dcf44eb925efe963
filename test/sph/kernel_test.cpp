#include "brash_ice_rig/sph/kernel.h"

#include <gtest/gtest.h>

#include "brash_ice_rig/math/angle.h"

namespace brash_ice_rig {
namespace {

TEST(CubicSpline, IntegratesToOneOverItsSupport) {
  const CubicSpline kernel{0.36};
  const int shells = 20000;
  const double width = kernel.support() / shells;
  double integral = 0.0;
  for (int k = 0; k < shells; ++k) {
    const double r = (k + 0.5) * width;
    integral += 4.0 * kPi * r * r * kernel.value(r) * width;
  }
  EXPECT_NEAR(integral, 1.0, 1e-6);
}

TEST(CubicSpline, ValueAtTheCentreIsOneOverPiHCubed) {
  EXPECT_NEAR(CubicSpline{2.0}.value(0.0), 1.0 / (8.0 * kPi), 1e-15);
}

TEST(CubicSpline, ValueAtOneSmoothingLengthIsAQuarterOfTheCentre) {
  const CubicSpline kernel{0.5};
  EXPECT_NEAR(kernel.value(0.5) / kernel.value(0.0), 0.25, 1e-14);
}

TEST(CubicSpline, DerivativeIsTheSlopeOfTheValue) {
  const CubicSpline kernel{0.36};
  for (double r = 0.01; r < 0.75; r += 0.013) {
    const double step = 1e-6;
    const double slope = (kernel.value(r + step) - kernel.value(r - step)) / (2.0 * step);
    EXPECT_NEAR(kernel.derivative(r), slope, 1e-5) << "r = " << r;
  }
}

TEST(CubicSpline, VanishesBeyondTwoSmoothingLengths) {
  const CubicSpline kernel{0.36};
  EXPECT_EQ(kernel.value(0.72), 0.0);
  EXPECT_EQ(kernel.derivative(0.72), 0.0);
}

TEST(SmoothingGrowth, IsTheCubeRootOfTheVolumeBetweenTheBoundsOfThePapersProgram) {
  EXPECT_NEAR(smoothingGrowth(0.729), 0.9, 1e-12);
  EXPECT_EQ(smoothingGrowth(1.0), 1.0);
  EXPECT_NEAR(smoothingGrowth(1.331), 1.1, 1e-12);
  // HMIN = 0.2 and HMAX = 2 of LS-DYNA's *SECTION_SPH.
  EXPECT_EQ(smoothingGrowth(0.001), 0.2);
  EXPECT_EQ(smoothingGrowth(27.0), 2.0);
}

}  // namespace
}  // namespace brash_ice_rig
