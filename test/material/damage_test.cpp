#include "brash_ice_rig/material/damage.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "brash_ice_rig/material/cap_model.h"
#include "brash_ice_rig/math/angle.h"
#include "element.h"
#include "set_one.h"

namespace brash_ice_rig {
namespace {

/// With damage: the fracture energies of Table 7, column B, are the defaults.
CapParameters withDamage(CapParameters parameters, double element_length_m, bool gap_memory = false) {
  parameters.damages = true;
  parameters.damage.element_length_m = element_length_m;
  parameters.gap_memory = gap_memory;
  return parameters;
}

CapParameters simulationB1(double element_length_m = 0.3, bool gap_memory = false) {
  return withDamage(setOne(), element_length_m, gap_memory);
}

CapParameters coneOfB1(double element_length_m = 0.3) {
  return withDamage(coneOfSetOne(), element_length_m);
}

/// Uniaxial test without lateral stress. Work per volume, J/m³, from the peak of the stress on.
/// @param step  axial strain of a step, > 0 in tension
double workAfterPeak(const CapModel& model, double step, int steps, double* peak_pa = nullptr) {
  Element element(model);
  double peak = 0.0, work = 0.0, last = 0.0;
  for (int i = 0; i < steps; ++i) {
    element.strainAxially(step, 0.0);
    const double stress = std::abs(element.stress(2));
    if (stress > peak) {
      peak = stress;
      work = 0.0;
    } else {
      work += 0.5 * (stress + last) * std::abs(step);
    }
    last = stress;
  }
  if (peak_pa != nullptr) *peak_pa = peak;
  return work;
}

// G_ft of Table 7, column B: 5.13E-04 MPa mm.
TEST(Damage, FractureEnergyInTensionIsThatOfTable7ForEachElementSize) {
  for (const double length : {0.15, 0.3, 0.6}) {
    const CapModel model(simulationB1(length));
    double peak = 0.0;
    // Ten times the strain at which a linear softening of that energy would end.
    const double strain = 10.0 * 2.0 * 0.513 / (205.0 * length);
    const double energy = workAfterPeak(model, strain / 20000.0, 20000, &peak) * length;
    EXPECT_NEAR(peak, 205.5, 1.0);  // where the cone meets uniaxial tension: alpha / (1 / sqrt(3) + theta)
    EXPECT_NEAR(energy, 0.513, 0.05 * 0.513) << length;
    std::printf("element of %.2f m: %.4f J/m2 in tension, Table 7 has 0.513\n", length, energy);
  }
}

// G_fc of Table 7, column B: 4.51E-03 MPa mm. Without the cap the undamaged stress is constant, as eq. 13 assumes.
TEST(Damage, FractureEnergyInUnconfinedCompressionIsThatOfTable7) {
  for (const double length : {0.15, 0.3, 0.6}) {
    const CapModel model(coneOfB1(length));
    double peak = 0.0;
    const double strain = 10.0 * 2.0 * 4.51 / (1103.0 * length);
    const double energy = workAfterPeak(model, -strain / 20000.0, 20000, &peak) * length;
    EXPECT_NEAR(peak, 1103.0, 5.0);  // alpha / (1 / sqrt(3) - theta)
    EXPECT_NEAR(energy, 4.51, 0.05 * 4.51) << length;
    std::printf("element of %.2f m: %.3f J/m2 in compression, Table 7 has 4.51\n", length, energy);
  }
}

TEST(Damage, FractureEnergyIsBlendedBetweenTheThreeTests) {
  DamageParameters p;
  p.fracture_energy_compression_jpm2 = 4.0;
  p.fracture_energy_tension_jpm2 = 2.0;
  p.fracture_energy_shear_jpm2 = 1.0;
  const Softening softening(p);
  const double root = std::sqrt(3.0);
  EXPECT_NEAR(softening.fractureEnergy(0.0, 1.0), 1.0, 1e-12);    // pure shear
  EXPECT_NEAR(softening.fractureEnergy(root, 1.0), 4.0, 1e-12);   // unconfined compression
  EXPECT_NEAR(softening.fractureEnergy(100.0, 1.0), 4.0, 1e-12);  // confined
  EXPECT_NEAR(softening.fractureEnergy(-root, 1.0), 2.0, 1e-12);  // uniaxial tension
  EXPECT_NEAR(softening.fractureEnergy(-1.0, 0.0), 2.0, 1e-12);   // all around
  EXPECT_NEAR(softening.fractureEnergy(-0.5 * root, 1.0), 1.5, 1e-12);
  EXPECT_NEAR(softening.fractureEnergy(0.5 * root, 1.0), 1.0 + 3.0 / 32.0, 1e-12);
}

// Li2(-1) = -pi²/12 (Abramowitz and Stegun 27.7.4).
TEST(Damage, DuctileRateHoldsTheDilogarithm) {
  DamageParameters p;
  p.ductile_shape = 1.0;
  p.element_length_m = 1.0;
  const Softening softening(p);
  EXPECT_NEAR(softening.ductileRate(0.0, 1.0), std::sqrt(8.0 * kPi * kPi / 12.0), 1e-9);
  // With a threshold: the energy that the rate stands for is the one asked for.
  const double rate = softening.ductileRate(0.7, 3.0);
  EXPECT_NEAR(8.0 / rate * (0.7 * std::log(2.0) + kPi * kPi / 12.0 / rate), 3.0, 1e-9);
}

TEST(Damage, BrittleRateIsThatOfTheClosedForm) {
  DamageParameters p;
  p.brittle_shape = 1.0;
  p.element_length_m = 0.3;
  EXPECT_NEAR(Softening(p).brittleRate(0.2, 0.5), 0.2 * 0.3 / 0.5 * 2.0 * std::log(2.0), 1e-12);
}

TEST(Damage, ConfinementLimitsDuctileDamage) {
  EXPECT_EQ(Softening::maxDuctileDamage(std::sqrt(3.0), 1.0), Softening::kMaxDamage);
  EXPECT_NEAR(Softening::maxDuctileDamage(4.0 * std::sqrt(3.0), 1.0), 0.125, 1e-12);
  EXPECT_EQ(Softening::maxDuctileDamage(1.0, 0.0), 0.0);
}

// Eq. of the softening curve as Murray writes it, d = ((1 + B) / (1 + B exp(-y)) - 1) / B.
TEST(Damage, FollowsMurraysCurve) {
  for (const double shape : {0.1, 1.0, 30.0}) {
    for (const double y : {0.0, 0.1, 1.0, 5.0}) {
      EXPECT_NEAR(Softening::damage(y, shape), ((1.0 + shape) / (1.0 + shape * std::exp(-y)) - 1.0) / shape, 1e-12);
    }
  }
}

TEST(Damage, NeverHealsAndStaysBelowOne) {
  for (const bool gap_memory : {false, true}) {
    const CapModel model(simulationB1(0.3, gap_memory));
    const std::vector<std::string> names{"brittle_damage", "ductile_damage"};
    std::mt19937_64 generator(5);
    std::normal_distribution<double> normal;
    double largest = 0.0;
    for (int path = 0; path < 200; ++path) {
      Element element(model);
      std::vector<double> before(names.size(), 0.0);
      std::array<double, kComponents> strain{};
      for (int i = 0; i < 200; ++i) {
        if (i % 10 == 0) {
          const double mean = normal(generator);
          for (std::size_t c = 0; c < kComponents; ++c) {
            strain[c] = 1e-4 * (normal(generator) + (c < 3 ? mean : 0.0));
          }
        }
        element.strain(strain);
        for (std::size_t n = 0; n < names.size(); ++n) {
          const double now = element.state(names[n]);
          ASSERT_GE(now, before[n]) << names[n] << " in path " << path << ", step " << i;
          ASSERT_LE(now, 0.99901);
          before[n] = now;
          largest = std::max(largest, now);
        }
      }
    }
    EXPECT_GT(largest, 0.5);
  }
}

// The modulus is scaled down to save time. Ice of 1 kPa at a thousandth of its modulus shortens by 0.6 % before it
// yields, more than the 0.3 % over which it then breaks: only what is left of that at the ice's own modulus may count.
TEST(Damage, DoesNotDependOnTheScalingOfTheModulus) {
  IceConfig ice;
  ice.cohesion_pa = 1000.0;
  ice.gap_memory = false;
  ice.cap_initial_intercept_pa = 1.0e8;
  for (const double direction : {1.0, -1.0}) {
    std::vector<double> damages;
    for (const double scale : {1.0, 1e-2, 1e-3}) {
      const CapModel model(makeCapParameters(ice, scale, 0.3));
      Element element(model);
      while (element.state("plastic_strain") < 1.0e-3)
        element.strainAxially(direction * (scale < 1.0 ? 1e-6 : 1e-7), 0.0);
      damages.push_back(element.state("damage"));
    }
    EXPECT_GT(damages[0], 0.2);
    EXPECT_LT(damages[0], 0.98);
    for (const double damage : damages) EXPECT_NEAR(damage, damages[0], 0.02) << "direction " << direction;
  }
}

TEST(Damage, BelowTheSurfaceThereIsNone) {
  const CapModel model(simulationB1());
  Element element(model);
  for (int i = 0; i < 50; ++i) element.strain({0.0, 0.0, 0.0, (i % 10 < 5 ? 1e-5 : -1e-5), 0.0, 0.0});
  EXPECT_EQ(element.state("damage"), 0.0);
}

TEST(Damage, CompactionAloneDoesNone) {
  const CapModel model(simulationB1());
  Element element(model);
  for (int i = 0; i < 400; ++i) element.strain({-1e-4, -1e-4, -1e-4, 0.0, 0.0, 0.0});
  EXPECT_GT(element.state("compaction"), 0.02);
  EXPECT_EQ(element.state("damage"), 0.0);
}

// (1 - d) takes away cohesion, not friction: of the triaxial strength, 3068.1 Pa on the cone, that part is left which
// needs no alpha, q = 3 theta sigma_3 / (1 / sqrt(3) - theta), and of the rest the share that this confinement keeps.
TEST(Damage, FrictionOutlivesCohesion) {
  const double confinement = 300.0;
  const double frictional = 3.0 * 0.396 * confinement / (1.0 / std::sqrt(3.0) - 0.396);
  const double cohesive = 200.0 / (1.0 / std::sqrt(3.0) - 0.396);
  ASSERT_NEAR(frictional + cohesive, 3068.1, 0.5);
  const CapModel model(coneOfB1());
  Element element(model);
  element.setStress({-confinement, -confinement, -confinement, 0.0, 0.0, 0.0});
  double peak = 0.0;
  for (int i = 0; i < 8000; ++i) {
    element.strainAxially(-1e-4, -confinement);
    peak = std::max(peak, element.stress(0) - element.stress(2));
  }
  EXPECT_NEAR(peak, frictional + cohesive, 0.01 * peak);
  const double left = 1.0 - element.state("damage");
  EXPECT_LT(left, 0.5);
  EXPECT_NEAR(element.stress(0) - element.stress(2), frictional + left * cohesive, 0.005 * frictional);
}

TEST(Damage, CrackedIceIsStiffAgainInCompression) {
  const CapModel model(simulationB1());
  Element element(model);
  for (int i = 0; i < 2000; ++i) element.strainAxially(1e-5, 0.0);
  EXPECT_GT(element.state("brittle_damage"), 0.8);
  EXPECT_EQ(element.state("damage"), element.state("brittle_damage"));
  while (element.j1() < 10.0) element.strain({-1e-5, -1e-5, -1e-5, 0.0, 0.0, 0.0});
  const double before = element.j1();
  element.strain({-1e-5, -1e-5, -1e-5, 0.0, 0.0, 0.0});
  EXPECT_EQ(element.state("damage"), element.state("ductile_damage"));
  EXPECT_NEAR((element.j1() - before) / 9e-5, model.bulkModulus(), 1e-3 * model.bulkModulus());
}

TEST(GapMemory, AnOpenedGapClosesBeforePressureReturns) {
  for (const bool damages : {false, true}) {
    CapParameters parameters = simulationB1(0.3, true);
    parameters.damages = damages;
    const CapModel model(parameters);
    Element element(model);
    const int opening_steps = 1000;
    const double step = 1e-5;
    for (int i = 0; i < opening_steps; ++i) element.strain({step, step, step, 0.0, 0.0, 0.0});
    const double opened = 3.0 * step * opening_steps;
    EXPECT_NEAR(element.state("gap"), opened, 0.03 * opened);  // the rest is elastic
    double closed = 0.0;
    while (element.j1() < 1.0 && closed < 2.0 * opened) {
      element.strain({-step, -step, -step, 0.0, 0.0, 0.0});
      closed += 3.0 * step;
    }
    EXPECT_NEAR(closed, opened, 4.0 * 3.0 * step);
    EXPECT_EQ(element.state("gap"), 0.0);
  }
}

TEST(GapMemory, WithoutItPressureReturnsAtOnce) {
  CapParameters parameters = simulationB1();
  parameters.damages = false;
  const CapModel model(parameters);
  Element element(model);
  const double step = 1e-5;
  for (int i = 0; i < 1000; ++i) element.strain({step, step, step, 0.0, 0.0, 0.0});
  double closed = 0.0;
  for (; element.j1() < 1.0; closed += 3.0 * step) element.strain({-step, -step, -step, 0.0, 0.0, 0.0});
  EXPECT_LT(closed, 0.1 * 3.0 * step * 1000);
}

}  // namespace
}  // namespace brash_ice_rig
