#pragma once

namespace brash_ice_rig {

/// Inputs of the damage of the continuous surface cap model (Table 7 of the paper).
struct DamageParameters {
  double element_length_m = 0.3;                   ///< L, cube root of a particle's volume, m, > 0
  double fracture_energy_compression_jpm2 = 4.51;  ///< G_fc, J/m², > 0
  double fracture_energy_tension_jpm2 = 0.513;     ///< G_ft, J/m², > 0
  double fracture_energy_shear_jpm2 = 0.513;       ///< G_fs, J/m², > 0
  double ductile_shape = 1.0;                      ///< B, > 0
  double brittle_shape = 1.0;                      ///< D, > 0
};

/// Softening of ice that breaks, so that a crack through it takes the same energy whatever the size of the particles.
///
/// Damage d grows with a measure y of what happened beyond the threshold, for both shapes (B or D) as
///   d = d_max ((1 + B) / (1 + B exp(-A y)) - 1) / B = d_max (1 - e) / (1 + B e),  e = exp(-A y).
/// The rate A follows from the fracture energy G and the element length L; the integrals behind that hold for an
/// element whose undamaged stress stays constant beyond the threshold, and d_max = 1.
///
/// Sources: Murray (2007), FHWA-HRT-05-062, chapter on damage; Simo and Ju (1987). The integrals are in doc/theory.md.
class Softening {
 public:
  /// Largest damage: a rest of the stress keeps the ice from becoming nothing (Murray 2007).
  static constexpr double kMaxDamage = static_cast<double>(0.999f);

  /// Parameters outside their ranges are a bug of the caller (assert).
  explicit Softening(const DamageParameters& parameters);

  /// Fracture energy between the three tests that it is measured in, J/m²: from shear to tension in proportion to
  /// -J1 / sqrt(3 J2), from shear to compression with the fifth power of J1 / sqrt(3 J2) (the exponents pwrt = 1 and
  /// pwrc = 5 that Murray recommends). Beyond 1 the ratio counts as 1.
  /// @param j1_pa  -tr(stress), Pa
  /// @param s_pa   sqrt(J2'), Pa, ≥ 0
  double fractureEnergy(double j1_pa, double s_pa) const;

  /// Largest ductile damage, ratio: confinement keeps the blocks together. (sqrt(3 J2) / J1)^1.5, at most kMaxDamage.
  /// @param j1_pa  ≥ 0
  static double maxDuctileDamage(double j1_pa, double s_pa);

  /// Rate A of ductile damage in y = tau_c - r0, tau_c = sqrt(stress : strain / 2), 1/sqrt(Pa): solves
  ///   G / L = 4 (1 + B) / (A B) (r0 ln(1 + B) - Li2(-B) / A).
  /// @param threshold  r0, sqrt(Pa), ≥ 0
  double ductileRate(double threshold, double fracture_energy_jpm2) const;

  /// Rate C of brittle damage in y = tau_t - r0, tau_t = sqrt(E) times the largest principal strain, 1/sqrt(Pa):
  ///   G / L = r0 (1 + D) ln(1 + D) / (C D).
  /// @param threshold  r0, sqrt(Pa), > 0
  double brittleRate(double threshold, double fracture_energy_jpm2) const;

  /// d for d_max = 1.
  /// @param rate_times_y  A y, ≥ 0
  static double damage(double rate_times_y, double shape);

  /// (1 + B) ln(1 + B) / B, -(1 + B) Li2(-B) / B and (1 + D) ln(1 + D) / D, which those rates are made of.
  double ductileLog() const { return ductile_log_; }
  double ductileDilog() const { return ductile_dilog_; }
  double brittleLog() const { return brittle_log_; }

 private:
  DamageParameters parameters_;
  double ductile_log_, ductile_dilog_, brittle_log_;
};

}  // namespace brash_ice_rig
