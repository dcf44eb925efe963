#pragma once

#include <cmath>

#include "brash_ice_rig/ice/ice_scaling.h"
#include "brash_ice_rig/material/cap_model.h"

namespace brash_ice_rig {

/// Drucker-Prager cone with the collapse load of a Mohr-Coulomb material in plane strain, both with associated flow
/// (Drucker and Prager 1952; Chen and Mizuno 1990, section 5.3):
///   theta = tan(phi) / sqrt(9 + 12 tan²(phi)),  alpha = 3 c / sqrt(9 + 12 tan²(phi))
/// Since theta < 1/sqrt(12) = 0.289 for each phi, a steeper cone has no plane collapse load at all: eq. 10, which
/// matches triaxial compression, crosses that at phi = 36.9°, sin(phi) = 0.6.
/// @param cohesion_pa         c, Pa, > 0
/// @param friction_angle_deg  phi, degrees, 0 < phi < 90
inline ShearSurface matchPlaneStrain(double cohesion_pa, double friction_angle_deg) {
  const double tangent = std::tan(friction_angle_deg * 3.14159265358979323846 / 180.0);
  const double root = std::sqrt(9.0 + 12.0 * tangent * tangent);
  return {3.0 * cohesion_pa / root, tangent / root};
}

/// A cap model of which only the cone counts: with X0 = 1 MPa the cap begins hundreds of times above any pressure here.
inline CapParameters capOutOfTheWay(const ShearSurface& cone, double elastic_modulus_pa) {
  const ElasticModuli moduli = computeElasticModuli(elastic_modulus_pa, 0.3);
  CapParameters p;
  p.alpha_pa = cone.constant_pa;
  p.theta = cone.slope;
  p.aspect_ratio = 1.0;
  p.initial_intercept_pa = 1.0e6;
  p.max_compaction = 0.093;
  p.d1_per_pa = 86.0e-6;
  p.bulk_modulus_pa = moduli.bulk_pa;
  p.shear_modulus_pa = moduli.shear_pa;
  return p;
}

}  // namespace brash_ice_rig
