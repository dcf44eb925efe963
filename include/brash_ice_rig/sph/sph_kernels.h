#pragma once

#include <cstddef>
#include <cstdint>

#include "brash_ice_rig/simd/instruction_set.h"

namespace brash_ice_rig {

/// Eight pairs of one row, pair by pair in the lanes: the cached gradient grad W_ij times V_j, 1/m, the factor Q that
/// turns (dv . g) g into the viscous force over V_i, and the neighbour. Lanes without a pair hold zeros and the row's
/// own particle.
struct alignas(32) PairBlock {
  static constexpr std::size_t kPairs = 8;
  float gx[kPairs], gy[kPairs], gz[kPairs], q[kPairs];
  /// 8 j: times 2 or 8, which costs nothing in an address, it is the way to the velocity or the stress of particle j.
  std::uint32_t eightfold_neighbour[kPairs];
};

/// sigma_i B_i by columns, Pa; the fourth row and column are 0, so that each lies in one cache line.
struct alignas(64) CorrectedStress {
  float column[4][4];
};

/// Vector of x, y, z and a fourth component that is 0, unless something else is said.
struct alignas(16) Padded3 {
  float component[4];
};

/// Where gradients see a particle, in units of SphSites, and its h.
struct alignas(16) SphSite {
  std::int32_t x, y, z;
  float smoothing_length_m;
};

/// What gradients are computed from, one entry per particle.
struct SphSites {
  const SphSite* site;
  const float* volume;  ///< m³
  float unit_m;         ///< a power of 2
  float viscosity;      ///< rho alpha c, Pa s/m
};

/// What a sweep over rows reads and writes, one entry per particle.
struct SphRows {
  const PairBlock* blocks;  ///< of row i: blocks[block_begin[i]] .. block_count[i] of them
  const std::size_t* block_begin;
  const std::int32_t* block_count;
  const Padded3* velocity;      ///< m/s; the fourth: share of its viscosity that a particle goes without
  const float* correction[9];   ///< B_i, row by row
  const Padded3* gradient_sum;  ///< sum_j V_j grad W_ij, 1/m
  const float* cached_volume;   ///< m³
  float* strain_increment[6];   ///< order of material.h
  float* stress[6];             ///< likewise, Pa
  float* const* tensors;        ///< further symmetric tensors that turn with the particle, six arrays each
  std::size_t tensor_count;
  float* volume;  ///< m³
  CorrectedStress* corrected_stress;
  Padded3* viscosity;  ///< viscous force over V_i, N/m³
  Padded3* force;      ///< internal force, N
};

/// Most particles that strain() and correctStress() take at a time: their arrays stay in the first-level cache.
constexpr std::size_t kSphTile = 128;

/// The sweeps over all rows, and the gradients of one. The formulas are in sph_body.h; test/sph writes them plainly.
struct SphKernels {
  /// Velocity gradient, strain increment, viscosity and volume of particles [begin, end), at most kSphTile of them;
  /// turns stress and tensors.
  /// @param smallest_volume, largest_volume  m³, bounds of the volume
  void (*strain)(const SphRows& rows, std::size_t begin, std::size_t end, float time_step_s, float smallest_volume,
                 float largest_volume);

  /// sigma_i B_i of particles [begin, end), at most kSphTile of them.
  void (*correctStress)(const SphRows& rows, std::size_t begin, std::size_t end);

  /// Internal force, viscosity included, on particles [begin, end).
  void (*force)(const SphRows& rows, std::size_t begin, std::size_t end);

  /// Velocity gradient of one particle, 1/s, row by row.
  void (*velocityGradient)(const SphRows& rows, std::size_t i, float* gradient);

  /// Fills the row of particle i from the candidates within reach.
  /// @param neighbour  scratch, room for count + 16
  /// @param room       of `row`, blocks; what needs more is not computed
  /// @param sum        out: sum of the gradients, 1/m
  /// @param moment     out: M_i, ratio, xx, yy, zz, xy, yz, zx
  /// @param viscosity  out: sum_j Q_ij |V_j grad W_ij|², N s/m⁴: viscous force over V_i and velocity, were all of i's
  ///   neighbours held and each in the direction of its motion
  /// @return number of blocks that the row needs
  std::int32_t (*refresh)(const SphSites& sites, std::size_t i, const std::int32_t* candidates, std::size_t count,
                          std::int32_t* neighbour, PairBlock* row, std::size_t room, Padded3* sum, double* moment,
                          double* viscosity);
};

/// @param set  one of availableInstructionSets()
const SphKernels& sphKernels(InstructionSet set);

}  // namespace brash_ice_rig
