#pragma once

#include <cstddef>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/system/state_visitor.h"

namespace brash_ice_rig {

/// Bounds that no test can pass as long as the integration holds (doc/reliability.md). They are generous, so that no
/// physics comes near, and an explosion is soon beyond them. SI.
class NumericalGuard {
 public:
  /// @param ice_mass_kg  of all particles, as SphBody has it
  NumericalGuard(const Scenario& scenario, double ice_mass_kg);

  /// A speed that no ice of a scenario can have, m/s: twice that after a fall from where the crane can lift it to,
  /// thrown by the crane; and 10 m/s more for effects, which may move the rig faster than its crane.
  static double computeFastest(const Scenario& scenario);

  /// Work of crane or arms in a step, J; its size counts.
  void addWork(double work_j);
  /// Kinetic energy that the ice can have, J: all work so far, and what the ice may release by itself. A floating layer
  /// of thickness T that spreads releases at most m g (1 - rho_ice / rho_water) T / 2. One spacing is added to the
  /// lever (1 - rho_ice / rho_water) T / 2: a lattice starts unstressed, blocks are moved aside for the pole, and
  /// effects make patches of other density and thickness.
  double energyBound() const { return released_j_ + put_in_j_; }

  void visitState(StateVisitor& visitor);

 private:
  double released_j_;
  double put_in_j_ = 0.0;
};

}  // namespace brash_ice_rig
