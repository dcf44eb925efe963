#include "brash_ice_rig/material/material.h"

namespace brash_ice_rig {

double Material::elasticEnergyDensity(const std::array<float, kComponents>& stress_pa,
                                      const std::vector<float>& /*state*/) const {
  std::array<double, kComponents> s{};
  for (std::size_t c = 0; c < kComponents; ++c) s[c] = static_cast<double>(stress_pa[c]);
  const double j1 = -(s[0] + s[1] + s[2]);
  for (std::size_t c = 0; c < 3; ++c) s[c] += j1 / 3.0;
  const double j2 = 0.5 * (s[0] * s[0] + s[1] * s[1] + s[2] * s[2]) + s[3] * s[3] + s[4] * s[4] + s[5] * s[5];
  return j1 * j1 / (18.0 * bulkModulus()) + j2 / (2.0 * shearModulus());
}

}  // namespace brash_ice_rig
