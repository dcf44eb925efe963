#include "brash_ice_rig/material/cap_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "brash_ice_rig/ice/ice_scaling.h"
#include "element.h"
#include "set_one.h"

namespace brash_ice_rig {
namespace {

/// A point at hydrostatic pressure J1 / 3, reached elastically.
Element elementAtJ1(const Material& material, double j1_pa) {
  Element element(material);
  element.setStress({-j1_pa / 3.0, -j1_pa / 3.0, -j1_pa / 3.0, 0.0, 0.0, 0.0});
  return element;
}

void shearAtConstantVolume(Element& element, double strain, double step = 1e-5) {
  for (double sheared = 0.0; sheared < strain; sheared += step) element.strain({0.0, 0.0, 0.0, step, 0.0, 0.0});
}

double triaxialStrength(const CapModel& model, double confinement_pa, double* intercept = nullptr) {
  Element element = elementAtJ1(model, 3.0 * confinement_pa);
  for (int i = 0; i < 6000; ++i) element.strainAxially(-1e-4, -confinement_pa);
  if (intercept != nullptr) *intercept = model.capIntercept(element.state("compaction"));
  return element.stress(0) - element.stress(2);
}

TEST(CapModel, CapStartsWhereAspectRatioSays) {
  EXPECT_NEAR(CapModel(setOne()).capStart(0.0), 45.88, 0.005);
}

TEST(CapModel, YieldBeginsOnTheSurfaceOfEq9) {
  const CapModel model(setOne());
  const std::pair<double, double> points[] = {{0.0, 200.0}, {656.0, 436.8}, {45.88, 218.168}};
  for (const auto& [j1, s] : points) {
    EXPECT_NEAR(model.shearStrength(j1, 0.0), s, 0.05) << "J1 " << j1;
    for (const double factor : {0.9995, 1.0005}) {
      Element element = elementAtJ1(model, j1);
      element.strain({0.0, 0.0, 0.0, factor * s / (2.0 * model.shearModulus()), 0.0, 0.0});
      EXPECT_EQ(element.state("plastic_strain") > 0.0, factor > 1.0) << "J1 " << j1;
    }
  }
}

TEST(CapModel, PureCompressionYieldsAtTheInitialIntercept) {
  const CapModel model(setOne());
  for (const double j1 : {1999.9, 2000.1}) {
    Element element(model);
    const double strain = -j1 / (9.0 * model.bulkModulus());
    element.strain({strain, strain, strain, 0.0, 0.0, 0.0});
    EXPECT_EQ(element.state("compaction") > 0.0, j1 > 2000.0);
    EXPECT_NEAR(element.j1(), j1, 0.1);
    EXPECT_EQ(element.s(), 0.0);
  }
}

TEST(CapModel, PureTensionEndsAtTheApex) {
  for (const FlowRule flow_rule : {FlowRule::kAssociated, FlowRule::kNonAssociated}) {
    const CapModel model(setOne(flow_rule));
    Element element(model);
    for (int i = 0; i < 100; ++i) element.strain({1e-5, 1e-5, 1e-5, 0.0, 0.0, 0.0});
    EXPECT_NEAR(element.j1(), -505.05, 0.01);
    EXPECT_EQ(element.s(), 0.0);
    EXPECT_EQ(element.state("compaction"), 0.0);
  }
}

TEST(CapModel, CapInterceptFollowsEq12) {
  CapParameters p = setOne();
  p.d2_per_pa2 = 4.0e-9;  // large enough to matter, unlike that of Table 6
  for (const CapParameters& parameters : {setOne(), p}) {
    const CapModel model(parameters);
    for (const double compaction : {1e-8, 0.001, 0.01, 0.05, 0.09}) {
      const double y = model.capIntercept(compaction) - 2000.0;
      const double exponent = -parameters.d1_per_pa * y - parameters.d2_per_pa2 * y * y;
      EXPECT_NEAR(0.093 * -std::expm1(exponent), compaction, 1e-9 * compaction);
    }
  }
}

TEST(CapModel, HydrostaticPathFollowsEq12) {
  // The strains of these reference values are total ones, at the full stiffness of B-1: plastic ones, eq. 12, and an
  // elastic share of J1 / (3 K), which is 0.2 Pa of X in the first value.
  CapParameters p = setOne();
  p.bulk_modulus_pa *= 1000.0;
  p.shear_modulus_pa *= 1000.0;
  const CapModel model(p);
  Element element(model);
  const double step = 1e-3;  // few, since float rounds the compaction in each
  int steps = 0;
  const std::pair<double, double> points[] = {{0.01, 3322.57}, {0.02, 4815.2}, {0.03, 6528.1}, {0.04, 8537.6}};
  for (const auto& [strain, intercept] : points) {
    for (; steps < std::lround(strain / step); ++steps) {
      element.strain({-step / 3.0, -step / 3.0, -step / 3.0, 0.0, 0.0, 0.0});
    }
    EXPECT_NEAR(element.j1(), intercept, 0.06) << "strain " << strain;
    EXPECT_NEAR(element.j1(), model.capIntercept(element.state("compaction")), 0.01);
  }
}

TEST(CapModel, ConstantVolumeShearEndsAtTheTopOfTheSurface) {
  const CapModel model(setOne());
  Element element = elementAtJ1(model, 600.0);
  shearAtConstantVolume(element, 0.05);
  EXPECT_NEAR(element.stress(3), 548.17, 0.01);
  EXPECT_NEAR(element.j1(), 1296.8, 0.05);
}

TEST(CapModel, NonAssociatedConstantVolumeShearEndsWhereTheCapStarts) {
  const CapModel model(setOne(FlowRule::kNonAssociated));
  Element element = elementAtJ1(model, 600.0);
  shearAtConstantVolume(element, 2.0, 1e-4);
  EXPECT_NEAR(element.stress(3), 221.0, 0.5);
  EXPECT_NEAR(element.j1(), model.capStart(element.state("compaction")), 1.0);
}

TEST(CapModel, NonAssociatedConeKeepsItsVolume) {
  const CapModel model(setOne(FlowRule::kNonAssociated));
  Element element = elementAtJ1(model, -100.0);
  shearAtConstantVolume(element, 0.01);
  EXPECT_NEAR(element.j1(), -100.0, 1e-3);
  EXPECT_NEAR(element.stress(3), 200.0 - 0.396 * 100.0, 1e-3);
  EXPECT_EQ(element.state("compaction"), 0.0);
}

struct ConfinedStrength {
  const char* name;
  double alpha_pa, theta, aspect_ratio, initial_intercept_pa, d1_per_pa, strength_pa;
};

class ConfinedStrengthOfSet : public ::testing::TestWithParam<ConfinedStrength> {};

TEST_P(ConfinedStrengthOfSet, IsTheTopOfTheSurface) {
  CapParameters p = setOne();
  p.alpha_pa = GetParam().alpha_pa;
  p.theta = GetParam().theta;
  p.aspect_ratio = GetParam().aspect_ratio;
  p.initial_intercept_pa = GetParam().initial_intercept_pa;
  p.d1_per_pa = GetParam().d1_per_pa;
  const CapModel model(p);
  Element element(model);
  shearAtConstantVolume(element, 0.1);
  EXPECT_NEAR(element.stress(3), GetParam().strength_pa, 0.5);
}

INSTANTIATE_TEST_SUITE_P(Table6, ConfinedStrengthOfSet,
                         ::testing::Values(ConfinedStrength{"B1", 200.0, 0.396, 8.957, 2000.0, 86e-6, 548.0},
                                           ConfinedStrength{"B2", 100.0, 0.396, 8.957, 450.0, 386e-6, 154.0},
                                           ConfinedStrength{"B2Eq10", 50.0, 0.396, 8.957, 450.0, 386e-6, 126.0},
                                           ConfinedStrength{"B3", 1000.0, 0.396, 8.957, 9000.0, 23e-6, 2522.0},
                                           ConfinedStrength{"B4", 200.0, 0.315, 17.205, 4000.0, 43e-6, 782.0},
                                           ConfinedStrength{"B5", 200.0, 0.469, 8.957, 4000.0, 386e-6, 1132.0}),
                         [](const auto& info) { return std::string(info.param.name); });

TEST(CapModel, DrainedTriaxialStrengthGrowsWithConfinement) {
  const CapModel model(setOne());
  double intercept = 0.0;
  EXPECT_NEAR(triaxialStrength(model, 100.0), 947.96, 0.05);
  EXPECT_NEAR(triaxialStrength(model, 300.0, &intercept), 1565.1, 0.1);
  EXPECT_NEAR(intercept, 3624.4, 1.0);
  EXPECT_NEAR(triaxialStrength(model, 1000.0, &intercept), 3904.4, 0.2);
  EXPECT_NEAR(intercept, 9796.3, 2.0);
}

TEST(CapModel, TriaxialStrengthWithoutCapIsThatOfTheCone) {
  const CapModel model(coneOfSetOne());
  EXPECT_NEAR(triaxialStrength(model, 100.0), 1757.9, 0.1);
  EXPECT_NEAR(triaxialStrength(model, 300.0), 3068.1, 0.1);
  EXPECT_NEAR(triaxialStrength(model, 1000.0), 7653.7, 0.2);
}

TEST(CapModel, UnconfinedStrength) {
  EXPECT_NEAR(triaxialStrength(CapModel(setOne()), 0.0), 845.0, 0.5);
  EXPECT_NEAR(triaxialStrength(CapModel(coneOfSetOne()), 0.0), 1103.0, 0.5);
}

TEST(CapModel, UniaxialStrainCompactsAlongTheCap) {
  const CapModel model(setOne());
  Element element(model);
  struct Point {
    double strain, axial_pa, lateral_pa;
  };
  double strain = 0.0;
  for (const Point& point : {Point{0.001, 1055.7, 398.0}, Point{0.01, 1715.1, 419.4}, Point{0.05, 5230.8, 1523.8}}) {
    const int steps = static_cast<int>(std::lround((point.strain - strain) / 1e-5));
    for (int i = 0; i < steps; ++i) element.strain({0.0, 0.0, -1e-5, 0.0, 0.0, 0.0});
    strain = point.strain;
    EXPECT_NEAR(-element.stress(2), point.axial_pa, 5e-4 * point.axial_pa) << strain;
    EXPECT_NEAR(-element.stress(0), point.lateral_pa, 5e-4 * point.lateral_pa) << strain;
  }
}

TEST(CapModel, ElasticUniaxialStrainHasPoissonsRatio) {
  const CapModel model(setOne());
  Element element(model);
  element.strain({0.0, 0.0, -1e-5, 0.0, 0.0, 0.0});
  EXPECT_NEAR(element.stress(0) / element.stress(2), 0.4286, 5e-5);
  EXPECT_EQ(element.state("plastic_strain"), 0.0);
}

TEST(CapModel, PlasticStrainIsAxialStrainAtConstantVolume) {
  const CapModel model(setOne());
  Element element(model);
  const double q = std::sqrt(3.0) * 548.17, strain = 0.5;
  for (int i = 0; i < 5000; ++i) element.strain({0.5e-4, 0.5e-4, -1e-4, 0.0, 0.0, 0.0});
  EXPECT_NEAR(element.state("plastic_strain"), strain - q / (3.0 * model.shearModulus()), 1e-4);
}

TEST(CapModel, DilationBringsTheCapBackToItsInitialInterceptOnly) {
  const CapModel model(setOne());
  Element element(model);
  for (int i = 0; i < 1000; ++i) element.strain({-1e-5, -1e-5, -1e-5, 0.0, 0.0, 0.0});
  EXPECT_GT(model.capIntercept(element.state("compaction")), 4000.0);
  double last = element.state("compaction");
  for (int i = 0; i < 20000; ++i) {
    element.strain({2e-6, 2e-6, 2e-6, 1e-5, 0.0, 0.0});
    EXPECT_LE(element.state("compaction"), last);
    last = element.state("compaction");
  }
  EXPECT_EQ(last, 0.0);
  EXPECT_EQ(model.capIntercept(last), 2000.0);
}

TEST(CapModel, TangentGoesOnSmoothlyWhereEq12NeedsInfinitePressure) {
  const CapModel model(setOne());
  const double onset = 0.9999 * 0.093, step = 1e-9;
  const double below = (model.capIntercept(onset - step) - model.capIntercept(onset - 2.0 * step)) / step;
  const double above = (model.capIntercept(onset + 2.0 * step) - model.capIntercept(onset + step)) / step;
  EXPECT_NEAR(model.capIntercept(onset), 1.09e5, 500.0);
  EXPECT_NEAR(above / below, 1.0, 1e-3);
}

/// The deviatoric strength at J1 = 0 that lies between elastic and plastic trials, by bisection over single steps.
/// @param angle_deg  Lode angle: 30 triaxial compression, 0 torsion, -30 triaxial extension
double strengthAtLodeAngle(const CapModel& model, double angle_deg) {
  const double third = 2.0 * M_PI / 3.0, theta = (angle_deg + 30.0) * M_PI / 180.0;
  double elastic = 0.0, plastic = 1000.0;
  while (plastic - elastic > 1e-3) {
    const double s = 0.5 * (elastic + plastic), strain = s / (std::sqrt(3.0) * model.shearModulus());
    Element element(model);
    element.strain(
        {strain * std::cos(theta), strain * std::cos(theta - third), strain * std::cos(theta + third), 0.0, 0.0, 0.0});
    (element.state("plastic_strain") > 0.0 ? plastic : elastic) = s;
  }
  return elastic;
}

TEST(CapModel, ThreeInvariantsLowerTorsionAndExtensionOnly) {
  CapParameters p = setOne();
  EXPECT_NEAR(strengthAtLodeAngle(CapModel(p), -30.0), 200.0, 0.01);
  p.three_invariant = true;
  const CapModel model(p);
  EXPECT_NEAR(strengthAtLodeAngle(model, 30.0), 200.0, 0.01);
  EXPECT_NEAR(strengthAtLodeAngle(model, 0.0), 0.5673 * 200.0, 0.01);
  EXPECT_NEAR(strengthAtLodeAngle(model, -30.0), 0.5 * 200.0, 0.01);
  EXPECT_NEAR(triaxialStrength(model, 0.0), 845.0, 0.5);
}

TEST(CapModel, ThreeInvariantSectionIsNearlyTheTriangleOfTheTensileLimit) {
  // A triangle would have 0.5 / cos(angle + 30°); eq. 11 dents its sides by Q1 = 0.5673 instead of 0.5774.
  CapParameters p = setOne();
  p.three_invariant = true;
  const CapModel model(p);
  for (double angle = -30.0; angle <= 30.0; angle += 2.5) {
    const double triangle = 200.0 * 0.5 / std::cos((angle + 30.0) * M_PI / 180.0);
    const double strength = strengthAtLodeAngle(model, angle);
    EXPECT_LE(strength, triangle + 0.01) << angle;
    EXPECT_GE(strength, 0.98 * triangle) << angle;
  }
}

TEST(CapParameters, ComeFromTheConfigurationOfSimulationB1) {
  const CapParameters p = makeCapParameters(IceConfig(), 1e-3, 0.3);
  EXPECT_NEAR(p.alpha_pa, 199.35, 0.005);
  EXPECT_NEAR(p.theta, 0.396, 5e-4);
  EXPECT_NEAR(p.bulk_modulus_pa, 751.34e3, 10.0);
  EXPECT_NEAR(p.shear_modulus_pa, 346.77e3, 10.0);
  EXPECT_EQ(p.aspect_ratio, 8.957);
  EXPECT_EQ(p.initial_intercept_pa, 2000.0);
  EXPECT_EQ(p.max_compaction, 0.093);
  EXPECT_EQ(p.d1_per_pa, 86.0e-6);
  EXPECT_EQ(p.d2_per_pa2, 0.03e-12);
  EXPECT_EQ(p.flow_rule, FlowRule::kAssociated);
  EXPECT_FALSE(p.three_invariant);
  EXPECT_TRUE(p.damages);
  EXPECT_TRUE(p.gap_memory);
  // Table 7, column B.
  EXPECT_NEAR(p.damage.fracture_energy_compression_jpm2, 4.51, 0.005);
  EXPECT_NEAR(p.damage.fracture_energy_tension_jpm2, 0.513, 5e-4);
  EXPECT_NEAR(p.damage.fracture_energy_shear_jpm2, 0.513, 5e-4);
  EXPECT_EQ(p.damage.element_length_m, 0.3);
}

TEST(CapParameters, GivenShearSurfaceReplacesEq10) {
  IceConfig ice;
  ice.shear_constant_pa = 100.0;
  ice.shear_slope = 0.3;
  ice.flow_rule = FlowRule::kNonAssociated;
  ice.three_invariant = true;
  const CapParameters p = makeCapParameters(ice, 1.0, 0.3);
  EXPECT_EQ(p.alpha_pa, 100.0);
  EXPECT_EQ(p.theta, 0.3);
  EXPECT_EQ(p.flow_rule, FlowRule::kNonAssociated);
  EXPECT_TRUE(p.three_invariant);
}

TEST(CapParameters, StiffnessScaleChangesTheModuliAlone) {
  const CapParameters full = makeCapParameters(IceConfig(), 1.0, 0.3), soft = makeCapParameters(IceConfig(), 1e-2, 0.3);
  EXPECT_NEAR(soft.bulk_modulus_pa / full.bulk_modulus_pa, 1e-2, 1e-12);
  EXPECT_NEAR(soft.shear_modulus_pa / full.shear_modulus_pa, 1e-2, 1e-12);
  EXPECT_EQ(soft.alpha_pa, full.alpha_pa);
  EXPECT_EQ(soft.initial_intercept_pa, full.initial_intercept_pa);
  EXPECT_EQ(soft.d1_per_pa, full.d1_per_pa);
  EXPECT_EQ(soft.damage.fracture_energy_tension_jpm2, full.damage.fracture_energy_tension_jpm2);
}

}  // namespace
}  // namespace brash_ice_rig
