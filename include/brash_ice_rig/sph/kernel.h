#pragma once

#include <algorithm>
#include <cmath>

#include "brash_ice_rig/math/angle.h"
#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {

/// Cubic B-spline in three dimensions (Monaghan 1992). Support 2 h.
struct CubicSpline {
  double smoothing_length_m;

  double support() const { return 2.0 * smoothing_length_m; }

  /// W, 1/m³.
  double value(double distance_m) const {
    const double q = distance_m / smoothing_length_m;
    if (q >= 2.0) return 0.0;
    const double tail = 2.0 - q;
    return scale() * (q < 1.0 ? 1.0 - 1.5 * q * q + 0.75 * q * q * q : 0.25 * tail * tail * tail);
  }

  /// dW/dr, 1/m⁴, <= 0.
  double derivative(double distance_m) const {
    const double q = distance_m / smoothing_length_m;
    if (q >= 2.0) return 0.0;
    const double tail = 2.0 - q;
    return scale() / smoothing_length_m * (q < 1.0 ? -3.0 * q + 2.25 * q * q : -0.75 * tail * tail);
  }

 private:
  double scale() const { return 1.0 / (kPi * smoothing_length_m * smoothing_length_m * smoothing_length_m); }
};

/// Smoothing length of a particle that follows its volume, over the one at rest: the cube root of V / V_0, at least 0.2
/// and at most 2. This is dh/dt = h div(v) / 3, integrated.
/// @param volume_ratio  V / V_0, > 0
/// Source: LS-DYNA Keyword User's Manual, *CONTROL_SPH (DERIV = 0) and *SECTION_SPH (HMIN = 0.2, HMAX = 2), the
/// defaults that section 4 of the paper ran with.
inline double smoothingGrowth(double volume_ratio) {
  return std::min(std::max(repeatable::cbrt(volume_ratio), 0.2), 2.0);
}

}  // namespace brash_ice_rig
