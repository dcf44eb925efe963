#pragma once

#include <limits>

namespace brash_ice_rig {

/// Allowed interval of a numeric key; an open bound is itself not allowed.
struct Range {
  double min = -std::numeric_limits<double>::max();
  double max = std::numeric_limits<double>::max();
  bool min_open = false;
  bool max_open = false;

  /// NaN and infinity are never contained.
  bool contains(double value) const {
    return (min_open ? value > min : value >= min) && (max_open ? value < max : value <= max);
  }
};

}  // namespace brash_ice_rig
