#pragma once

#include <cstddef>
#include <cstdint>

#include "brash_ice_rig/simd/instruction_set.h"

namespace brash_ice_rig {

// The cap model for many particles at a time. CapModel says what is computed; here are only plain structures, since the
// code behind them is compiled once per instruction set.

// What both paths, in lanes and one by one, call settled.
constexpr double kStressResolution = 5e-7;      // relative; stress lives in float between steps
constexpr double kCompactionResolution = 7e-8;  // relative; a little more than what rounding to float takes
constexpr double kDamageResolution = 2e-7;      // absolute
constexpr double kTipOfCap = 0.1;               // F_c below which the squared form of the residual is used
constexpr double kResidualTolerance = 1e-9;     // of the strength sqrt(F_c)
constexpr double kTipTolerance = 1e-14;         // of F_c
constexpr double kBracketTolerance = 1e-14;     // of the trial's strain
constexpr int kMaxNewtonSteps = 30;

/// What the kernels know of a cap model. Symbols are those of CapModel and Softening.
struct CapConstants {
  double alpha_pa, theta, inverse_aspect_ratio;
  double initial_intercept_pa, max_compaction, d1_per_pa, d2_per_pa2;
  double bulk_modulus_pa, shear_modulus_pa, stiffness_scale;
  double apex_pa, width_ratio, neutral;
  double tangent_onset;
  double smallest_lode_factor;  ///< 1 where strength does not depend on the Lode angle
  bool associated, gap_memory, damages;
  bool leaves_yielding;  ///< settle elastic particles only
  // Of damage.
  double root_elastic;  ///< sqrt(E) of the ice's own modulus, sqrt(Pa)
  double element_length_m;
  double fracture_energy_compression_jpm2, fracture_energy_tension_jpm2, fracture_energy_shear_jpm2;
  double max_damage, ductile_shape, brittle_shape;
  double ductile_log, ductile_dilog, brittle_log;  ///< integrals of Softening
};

/// Where a state of the cap model is in CapBatch::state. The six components of the total strain come last.
enum CapState : std::size_t {
  kCompaction,
  kPlasticStrain,
  kGap,
  kDamage,
  kBrittleDamage,
  kDuctileDamage,
  kBrittleThreshold,
  kDuctileThreshold,
  kTotalStrain,
  kCapStates = kTotalStrain + 6
};

/// Arrays of particles, in the order of components of MaterialBatch.
struct CapBatch {
  const float* strain_increment[6];
  float* stress[6];
  float* state[kCapStates];  ///< null: the model has no such state
};

/// Particles that one call of a kernel may be given.
constexpr std::size_t kCapTile = 128;

/// One table per instruction set.
struct CapKernels {
  /// Updates the particles [begin, begin + count) of a batch, count ≤ kCapTile. Those that it cannot settle, because
  /// a value is not finite or the return does not converge, are left as they were.
  /// @param left  receives their distance from begin, room for kCapTile
  /// @return how many are left
  std::size_t (*update)(const CapConstants& constants, const CapBatch& batch, std::size_t begin, std::size_t count,
                        std::uint32_t* left);

  // The functions behind it, for tests; `count` values each.

  /// ln x of a positive normal number.
  void (*computeLog)(const double* x, double* result, std::size_t count);
  /// e^x, for |x| ≤ 700; beyond, that of the nearer end.
  void (*computeExp)(const double* x, double* result, std::size_t count);
  /// Largest eigenvalue of a symmetric tensor.
  /// @param tensors  six arrays of components, in the order of MaterialBatch
  void (*computeLargestPrincipal)(const double* const* tensors, double* result, std::size_t count);
};

/// The kernels of an available instruction set; all give the same bits.
const CapKernels& capKernels(InstructionSet set);

}  // namespace brash_ice_rig
