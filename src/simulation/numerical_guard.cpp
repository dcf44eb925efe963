#include "brash_ice_rig/simulation/numerical_guard.h"

#include <algorithm>
#include <cmath>

namespace brash_ice_rig {

NumericalGuard::NumericalGuard(const Scenario& scenario, double ice_mass_kg) {
  const double submerged = scenario.ice.parent_density_kgpm3 / scenario.water.density_kgpm3;
  const double lever = 0.5 * (1.0 - submerged) * latticeThickness(scenario.field) + scenario.field.spacing_m;
  released_j_ = ice_mass_kg * kGravityMps2 * lever;
}

double NumericalGuard::computeFastest(const Scenario& scenario) {
  constexpr double kMargin = 2.0, kMarginMps = 10.0;
  const double height = std::max(scenario.crane.max_height_m, 0.0) + latticeThickness(scenario.field);
  const double fall = std::sqrt(2.0 * kGravityMps2 * height);
  const double thrown = std::sqrt(3.0) * scenario.crane.max_speed_mps;  // the limit holds for each axis
  return kMargin * (fall + thrown) + kMarginMps;
}

void NumericalGuard::addWork(double work_j) {
  put_in_j_ += std::abs(work_j);
}

void NumericalGuard::visitState(StateVisitor& visitor) {
  visitor("put_in_j", put_in_j_);
}

}  // namespace brash_ice_rig
