#include "brash_ice_rig/material/scaled_strength.h"

#include <cmath>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/material/cap_model.h"
#include "element.h"

namespace brash_ice_rig {
namespace {

CapModel makeSet1(bool damage) {
  IceConfig ice;
  ice.damage = damage;
  ice.gap_memory = damage;
  return CapModel(makeCapParameters(ice, 1.0e-3, 0.3));
}

/// The same surface written out: what ScaledStrength promises of alpha, X0, W, D1, D2 and the fracture energies.
CapModel makeScaledSet1(bool damage, double m) {
  CapParameters p = makeSet1(damage).parameters();
  p.alpha_pa *= m;
  p.initial_intercept_pa *= m;
  p.max_compaction *= m;
  p.d1_per_pa /= m;
  p.d2_per_pa2 /= m * m;
  p.damage.fracture_energy_compression_jpm2 *= m * m;
  p.damage.fracture_energy_tension_jpm2 *= m * m;
  p.damage.fracture_energy_shear_jpm2 *= m * m;
  return CapModel(p);
}

TEST(ScaleStrength, OfAScenariosIceIsThatOfAParticle) {
  for (const double m : {0.4, 1.5}) {
    IceConfig ice;
    ice.damage = ice.gap_memory = true;
    scaleStrength(ice, m);
    const CapParameters scaled = makeCapParameters(ice, 1.0e-3, 0.3), expected = makeScaledSet1(true, m).parameters();
    EXPECT_NEAR(scaled.alpha_pa, expected.alpha_pa, 1e-9 * expected.alpha_pa);
    EXPECT_EQ(scaled.theta, expected.theta);
    EXPECT_NEAR(scaled.initial_intercept_pa, expected.initial_intercept_pa, 1e-9 * expected.initial_intercept_pa);
    EXPECT_NEAR(scaled.max_compaction, expected.max_compaction, 1e-12);
    EXPECT_NEAR(scaled.d1_per_pa, expected.d1_per_pa, 1e-9 * expected.d1_per_pa);
    EXPECT_NEAR(scaled.d2_per_pa2, expected.d2_per_pa2, 1e-9 * expected.d2_per_pa2);
    const DamageParameters &a = scaled.damage, &b = expected.damage;
    EXPECT_NEAR(a.fracture_energy_compression_jpm2, b.fracture_energy_compression_jpm2, 1e-9);
    EXPECT_NEAR(a.fracture_energy_tension_jpm2, b.fracture_energy_tension_jpm2, 1e-9);
    EXPECT_NEAR(a.fracture_energy_shear_jpm2, b.fracture_energy_shear_jpm2, 1e-9);
    EXPECT_EQ(scaled.bulk_modulus_pa, expected.bulk_modulus_pa);
  }
}

TEST(ScaleStrength, KeepsALegalCompaction) {
  IceConfig ice;
  ice.cap_max_compaction = 0.5;
  scaleStrength(ice, 3.0);
  EXPECT_EQ(ice.cap_max_compaction, 0.9);
}

/// Stress at the end of a confined shear from 200 Pa of pressure.
double confinedShearStrength(const Material& material, double surplus) {
  Element element(material);
  element.setStress({-200.0, -200.0, -200.0, 0.0, 0.0, 0.0});
  if (surplus != 0.0) element.setState("strength_surplus", surplus);
  for (int k = 0; k < 4000; ++k) element.strain({0.0, 0.0, 0.0, 2.0e-5, 0.0, 0.0});
  return element.s();
}

TEST(ScaledStrength, AtSurplusZeroIsTheOtherMaterialToTheLastBit) {
  const CapModel base = makeSet1(true);
  const ScaledStrength scaled(base);
  Element plain(base), same(scaled);
  for (int k = 0; k < 2000; ++k) {
    const std::array<double, kComponents> step = {1e-5 * std::sin(0.01 * k),  -2e-5, 1e-5 * std::cos(0.003 * k),
                                                  3e-5 * std::sin(0.002 * k), 1e-6,  0.0};
    plain.strain(step);
    same.strain(step);
    for (std::size_t c = 0; c < kComponents; ++c) ASSERT_EQ(plain.stress(c), same.stress(c));
    for (const std::string& name : base.stateNames()) ASSERT_EQ(plain.state(name), same.state(name)) << name;
  }
}

TEST(ScaledStrength, IsTheCapModelWithScaledParametersAlongARandomPath) {
  for (const bool damage : {false, true}) {
    for (const double m : {0.5, 2.0, 4.0}) {
      SCOPED_TRACE(std::string(damage ? "damage" : "no damage") + ", m = " + std::to_string(m));
      const CapModel base = makeSet1(damage), direct = makeScaledSet1(damage, m);
      const ScaledStrength scaled(base);
      Element wanted(direct), element(scaled);
      element.setState("strength_surplus", m - 1.0);
      std::mt19937_64 generator(7);
      std::array<double, kComponents> step{};
      for (int k = 0; k < 600; ++k) {
        if (k % 30 == 0) {
          // The path turns: shear, pressure and tension, from within the surface to far beyond it.
          for (double& strain : step) strain = 2.0e-5 * (static_cast<double>(generator() >> 11) * 0x1p-52 - 1.0);
        }
        wanted.strain(step);
        element.strain(step);
        for (std::size_t c = 0; c < kComponents; ++c) ASSERT_NEAR(element.stress(c), wanted.stress(c), 1.0) << k;
      }
      EXPECT_GT(wanted.state("plastic_strain"), 1e-3);
      for (const std::string& name : base.stateNames()) {
        EXPECT_NEAR(element.state(name), wanted.state(name), 1e-3 * std::abs(wanted.state(name)) + 1e-6) << name;
      }
    }
  }
}

TEST(ScaledStrength, ConfinedShearStrengthIsMultiplied) {
  // max(F_f sqrt(F_c)) = 548.17 Pa for set 1 of Table 6; alpha here is 199.3 Pa from eq. 10.
  const CapModel base = makeSet1(false);
  const ScaledStrength scaled(base);
  const double plain = confinedShearStrength(base, 0.0);
  EXPECT_NEAR(plain, 547.0, 2.0);
  for (const double surplus : {-0.5, 0.5, 2.0}) {
    EXPECT_NEAR(confinedShearStrength(scaled, surplus), (1.0 + surplus) * plain, 0.005 * (1.0 + surplus) * plain)
        << surplus;
  }
}

TEST(ScaledStrength, TensileStrengthIsMultiplied) {
  const CapModel base = makeSet1(false);
  const ScaledStrength scaled(base);
  Element element(scaled);
  element.setState("strength_surplus", 1.0);
  for (int k = 0; k < 1000; ++k) element.strain({1e-5, 1e-5, 1e-5, 0.0, 0.0, 0.0});
  const double apex = base.parameters().alpha_pa / base.parameters().theta;
  EXPECT_NEAR(element.j1(), -2.0 * apex, 1e-3 * apex);
}

TEST(ScaledStrength, ElasticResponseAndEnergyDoNotChange) {
  const CapModel base = makeSet1(false);
  const ScaledStrength scaled(base);
  Element plain(base), stronger(scaled);
  stronger.setState("strength_surplus", 1.5);
  plain.strain({1e-5, -2e-5, 0.0, 2e-5, 0.0, 1e-5});
  stronger.strain({1e-5, -2e-5, 0.0, 2e-5, 0.0, 1e-5});
  std::array<float, kComponents> stress{};
  for (std::size_t c = 0; c < kComponents; ++c) {
    EXPECT_NEAR(stronger.stress(c), plain.stress(c), 1e-6 * std::abs(plain.stress(c)) + 1e-9);
    stress[c] = static_cast<float>(plain.stress(c));
  }
  const double energy = base.elasticEnergyDensity(stress, {0.0f, 0.0f});
  EXPECT_GT(energy, 0.0);
  EXPECT_NEAR(scaled.elasticEnergyDensity(stress, {1.5f, 0.0f, 0.0f}), energy, 1e-6 * energy);
}

TEST(ScaledStrength, StressFollowsAFallingStrength) {
  const CapModel base = makeSet1(false);
  const ScaledStrength scaled(base);
  Element element(scaled);
  element.setStress({-200.0, -200.0, -200.0, 0.0, 0.0, 0.0});
  element.setState("strength_surplus", 1.0);
  for (int k = 0; k < 4000; ++k) element.strain({0.0, 0.0, 0.0, 2.0e-5, 0.0, 0.0});
  element.setState("strength_surplus", 0.0);
  for (int k = 0; k < 4000; ++k) element.strain({0.0, 0.0, 0.0, 2.0e-5, 0.0, 0.0});
  // Its cap has been driven further than it would have been without, so the surface is asked where it is.
  EXPECT_NEAR(element.s(), base.shearStrength(element.j1(), element.state("compaction")), 0.1);
  EXPECT_NEAR(element.s(), confinedShearStrength(base, 0.0), 0.05 * element.s());
}

}  // namespace
}  // namespace brash_ice_rig
