#include "brash_ice_rig/ice/ice_scaling.h"

#include <cassert>
#include <cmath>

#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {

double computeBrashElasticModulus(double parent_elastic_modulus_pa, double void_fraction) {
  assert(parent_elastic_modulus_pa > 0.0 && void_fraction >= 0.0 && void_fraction < 1.0);
  return parent_elastic_modulus_pa * (1.0 - std::sqrt(void_fraction));
}

ElasticModuli computeElasticModuli(double elastic_modulus_pa, double poisson_ratio) {
  assert(elastic_modulus_pa > 0.0 && poisson_ratio > -1.0 && poisson_ratio < 0.5);
  return {elastic_modulus_pa, elastic_modulus_pa / (3.0 * (1.0 - 2.0 * poisson_ratio)),
          elastic_modulus_pa / (2.0 * (1.0 + poisson_ratio))};
}

double computeBulkDensity(double parent_density_kgpm3, double void_fraction) {
  assert(parent_density_kgpm3 > 0.0 && void_fraction >= 0.0 && void_fraction < 1.0);
  return parent_density_kgpm3 * (1.0 - void_fraction);
}

double computeWaveSpeed(const ElasticModuli& moduli, double density_kgpm3) {
  assert(density_kgpm3 > 0.0);
  return std::sqrt((moduli.bulk_pa + 4.0 / 3.0 * moduli.shear_pa) / density_kgpm3);
}

double computeCompressiveFractureEnergy(double parent_fracture_energy_jpm2, double void_fraction) {
  assert(parent_fracture_energy_jpm2 > 0.0 && void_fraction >= 0.0 && void_fraction < 1.0);
  return parent_fracture_energy_jpm2 * (1.0 - std::sqrt(void_fraction));
}

double computeFractureToughness(double parent_toughness_pa_sqrt_m, double void_fraction) {
  assert(parent_toughness_pa_sqrt_m > 0.0 && void_fraction >= 0.0 && void_fraction < 1.0);
  return parent_toughness_pa_sqrt_m * (1.0 - std::sqrt(void_fraction));
}

double computeTensileFractureEnergy(double toughness_pa_sqrt_m, double elastic_modulus_pa, double poisson_ratio) {
  assert(toughness_pa_sqrt_m > 0.0 && elastic_modulus_pa > 0.0 && poisson_ratio > -1.0 && poisson_ratio < 0.5);
  return (1.0 - poisson_ratio * poisson_ratio) * toughness_pa_sqrt_m * toughness_pa_sqrt_m / elastic_modulus_pa;
}

ShearSurface computeShearSurface(double cohesion_pa, double friction_angle_deg) {
  assert(cohesion_pa >= 0.0 && friction_angle_deg > 0.0 && friction_angle_deg < 90.0);
  constexpr double kRadiansPerDegree = 3.14159265358979323846 / 180.0;
  const double phi = friction_angle_deg * kRadiansPerDegree;
  const double denominator = std::sqrt(3.0) * (3.0 - repeatable::sin(phi));
  return {6.0 * cohesion_pa * repeatable::cos(phi) / denominator, 2.0 * repeatable::sin(phi) / denominator};
}

}  // namespace brash_ice_rig
