#include "brash_ice_rig/material/damage.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {
namespace {

/// (1 + B) ln(1 + B) / B, which is the integral of 1 - d over A y from 0 to infinity.
double integralOfIntegrity(double shape) {
  return (1.0 + shape) * repeatable::log1p(shape) / shape;
}

/// -Li2(-x), the integral of ln(1 + t) / t from 0 to x, by Simpson's rule in u = ln(1 + t), which is smooth.
double minusDilogarithmOfMinus(double x) {
  const double end = repeatable::log1p(x);
  const auto integrand = [](double u) { return u > 0.0 ? u / -repeatable::expm1(-u) : 1.0; };
  constexpr int kIntervals = 200;
  const double width = end / kIntervals;
  double sum = integrand(0.0) + integrand(end);
  for (int i = 1; i < kIntervals; ++i) sum += (i % 2 == 1 ? 4.0 : 2.0) * integrand(i * width);
  return sum * width / 3.0;
}

}  // namespace

Softening::Softening(const DamageParameters& parameters) : parameters_(parameters) {
  const DamageParameters& p = parameters_;
  assert(p.element_length_m > 0.0 && p.ductile_shape > 0.0 && p.brittle_shape > 0.0);
  assert(p.fracture_energy_compression_jpm2 > 0.0 && p.fracture_energy_tension_jpm2 > 0.0);
  assert(p.fracture_energy_shear_jpm2 > 0.0);
  ductile_log_ = integralOfIntegrity(p.ductile_shape);
  brittle_log_ = integralOfIntegrity(p.brittle_shape);
  ductile_dilog_ = (1.0 + p.ductile_shape) / p.ductile_shape * minusDilogarithmOfMinus(p.ductile_shape);
}

double Softening::fractureEnergy(double j1_pa, double s_pa) const {
  const DamageParameters& p = parameters_;
  const double deviatoric = std::sqrt(3.0) * s_pa;
  const double ratio = std::abs(j1_pa) >= deviatoric ? 1.0 : std::abs(j1_pa) / deviatoric;
  const double shear = p.fracture_energy_shear_jpm2;
  if (j1_pa <= 0.0) return shear + ratio * (p.fracture_energy_tension_jpm2 - shear);
  const double fifth_power = ratio * ratio * ratio * ratio * ratio;
  return shear + fifth_power * (p.fracture_energy_compression_jpm2 - shear);
}

double Softening::maxDuctileDamage(double j1_pa, double s_pa) {
  const double deviatoric = std::sqrt(3.0) * s_pa;
  if (deviatoric >= j1_pa) return kMaxDamage;
  const double ratio = deviatoric / j1_pa;
  return std::min(kMaxDamage, ratio * std::sqrt(ratio));
}

double Softening::ductileRate(double threshold, double fracture_energy_jpm2) const {
  const double linear = threshold * ductile_log_;
  const double energy = fracture_energy_jpm2 / parameters_.element_length_m;
  // The positive root for 1 / A, in the form that subtracts nothing.
  return 2.0 * (linear + std::sqrt(linear * linear + ductile_dilog_ * energy)) / energy;
}

double Softening::brittleRate(double threshold, double fracture_energy_jpm2) const {
  return threshold * parameters_.element_length_m * brittle_log_ / fracture_energy_jpm2;
}

double Softening::damage(double rate_times_y, double shape) {
  const double e = repeatable::exp(-rate_times_y);
  return (1.0 - e) / (1.0 + shape * e);
}

}  // namespace brash_ice_rig
