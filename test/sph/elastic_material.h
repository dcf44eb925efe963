#pragma once

#include "brash_ice_rig/material/material.h"

namespace brash_ice_rig {

/// Isotropic Hooke, for tests of what the SPH part does on its own.
class ElasticMaterial : public Material {
 public:
  ElasticMaterial(double bulk_modulus_pa, double shear_modulus_pa) : bulk_(bulk_modulus_pa), shear_(shear_modulus_pa) {}

  std::vector<std::string> stateNames() const override { return {"plastic_strain"}; }
  double bulkModulus() const override { return bulk_; }
  double shearModulus() const override { return shear_; }

  void update(MaterialBatch& batch) const override {
    const auto lame = static_cast<float>(bulk_ - 2.0 / 3.0 * shear_);
    const auto twice_shear = static_cast<float>(2.0 * shear_);
    for (std::size_t i = 0; i < batch.count; ++i) {
      const float volume = batch.strain_increment[0][i] + batch.strain_increment[1][i] + batch.strain_increment[2][i];
      for (std::size_t c = 0; c < kComponents; ++c) {
        batch.stress[c][i] += twice_shear * batch.strain_increment[c][i] + (c < 3 ? lame * volume : 0.0f);
      }
    }
  }

 private:
  double bulk_, shear_;
};

}  // namespace brash_ice_rig
