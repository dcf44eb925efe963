#pragma once

#include <array>
#include <string>
#include <vector>

#include "brash_ice_rig/material/material.h"

namespace brash_ice_rig {

/// A material whose whole yield surface is m times that of another, m of each particle its own and free to change.
///
/// The other material is asked for stress / m under strain / m and the same moduli, and what it gives is multiplied
/// again. That is exact: the elastic law is linear, and a surface f(stress / m) = 0 is the other's, m times as large.
/// For the cap model: alpha and X0 grow with m, theta stays; the cap's first hardening stays too, and its largest
/// compaction W grows with m; fracture energies grow with m², as toughness squared does (eq. 15). The paper's own sets
/// scale in this way: in Table 6 X0 goes with alpha. State arrays hold true values: all that measure strain are divided
/// and multiplied like it, the names that end with "damage" are ratios and stay.
///
/// State: "strength_surplus" is m - 1, so that it starts at 0, and comes first; it is set from outside. Where it is 0
/// the result is that of the other material to the last bit.
class ScaledStrength : public Material {
 public:
  /// Smallest m; a smaller surplus counts as this.
  static constexpr float kLeastRatio = 0.01f;

  /// @param base  must outlive this
  explicit ScaledStrength(const Material& base);

  std::vector<std::string> stateNames() const override { return state_names_; }
  std::size_t stateTensors() const override { return base_.stateTensors(); }
  void update(MaterialBatch& batch) const override;
  double bulkModulus() const override { return base_.bulkModulus(); }
  double shearModulus() const override { return base_.shearModulus(); }
  double elasticEnergyDensity(const std::array<float, kComponents>& stress_pa,
                              const std::vector<float>& state) const override;

 private:
  void updateTile(const MaterialBatch& batch, std::size_t begin, std::size_t count) const;

  const Material& base_;
  std::vector<std::string> state_names_;
  std::vector<bool> scaled_;  ///< per state of the base: whether it goes with strain
};

}  // namespace brash_ice_rig
