#pragma once

namespace brash_ice_rig {

/// Elastic constants of an isotropic material, Pa.
struct ElasticModuli {
  double elastic_pa = 0.0;  ///< Young's modulus E
  double bulk_pa = 0.0;     ///< K
  double shear_pa = 0.0;    ///< G
};

/// Shear surface F_f(J1) = alpha + theta J1 (eq. 7 with lambda = 0).
struct ShearSurface {
  double constant_pa = 0.0;  ///< alpha, Pa
  double slope = 0.0;        ///< theta, no unit
};

/// Elastic modulus of brash ice from that of its parent level ice: E_br = E_ice (1 - sqrt(V_f)).
/// @param parent_elastic_modulus_pa  E_ice, Pa, > 0
/// @param void_fraction              V_f, ratio, 0 ≤ V_f < 1
/// @return E_br, Pa
/// Source: eq. 5.
double computeBrashElasticModulus(double parent_elastic_modulus_pa, double void_fraction);

/// Bulk and shear modulus of an isotropic material.
/// @param elastic_modulus_pa  E, Pa, > 0
/// @param poisson_ratio       nu, ratio, -1 < nu < 0.5
/// Source: eq. 6.
ElasticModuli computeElasticModuli(double elastic_modulus_pa, double poisson_ratio);

/// Mass of ice per volume of the field: rho_i (1 - V_f), kg/m³. The water in the voids is not part of it.
/// @param parent_density_kgpm3  rho_i, kg/m³, > 0
/// @param void_fraction         V_f, ratio, 0 ≤ V_f < 1
/// Source: last term of eq. 1.
double computeBulkDensity(double parent_density_kgpm3, double void_fraction);

/// Speed of an elastic compression wave, sqrt((K + 4 G / 3) / rho), m/s. The time step hangs on it.
/// @param density_kgpm3  bulk density, kg/m³, > 0
double computeWaveSpeed(const ElasticModuli& moduli, double density_kgpm3);

/// Fracture energy of brash ice in uniaxial compression: G_fc = G_f^C (1 - sqrt(V_f)).
/// @param parent_fracture_energy_jpm2  G_f^C of the parent level ice, J/m², > 0; 20 J/m² gives Table 7. Table 4 prints
///                                     2.0E-05 MPa mm, which would be 0.02 J/m²: 2.0E-05 is the same energy in MPa m.
/// @param void_fraction                V_f, ratio, 0 ≤ V_f < 1
/// @return G_fc, J/m²
/// Source: eq. 13.
double computeCompressiveFractureEnergy(double parent_fracture_energy_jpm2, double void_fraction);

/// Fracture toughness of brash ice: K_br = K_I (1 - sqrt(V_f)).
/// @param parent_toughness_pa_sqrt_m  K_I of the parent level ice, Pa sqrt(m), > 0; 1.0e5 in Table 4
/// @param void_fraction               V_f, ratio, 0 ≤ V_f < 1
/// @return K_br, Pa sqrt(m)
/// Source: eq. 14.
double computeFractureToughness(double parent_toughness_pa_sqrt_m, double void_fraction);

/// Fracture energy in uniaxial tension, and in pure shear, from toughness: G_ft = G_fs = (1 - nu²) K² / E.
/// @param toughness_pa_sqrt_m  K of the brash ice, Pa sqrt(m), > 0
/// @param elastic_modulus_pa   E of the brash ice at full stiffness, Pa, > 0
/// @param poisson_ratio        nu, ratio, -1 < nu < 0.5
/// @return J/m²
/// Source: eq. 15 (Irwin's relation in plane strain).
double computeTensileFractureEnergy(double toughness_pa_sqrt_m, double elastic_modulus_pa, double poisson_ratio);

/// Shear surface through the compressive meridian of a Mohr-Coulomb material:
///   alpha = 6 c cos(phi) / (sqrt(3) (3 - sin(phi))),  theta = 2 sin(phi) / (sqrt(3) (3 - sin(phi)))
/// @param cohesion_pa         c, Pa, ≥ 0
/// @param friction_angle_deg  phi, degrees, 0 < phi < 90
/// Source: eq. 10, whose print pulls the bracket under the root; the form above gives Table 6.
ShearSurface computeShearSurface(double cohesion_pa, double friction_angle_deg);

}  // namespace brash_ice_rig
