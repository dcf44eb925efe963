#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <vector>

namespace brash_ice_rig {

/// The value of a broken line at x: straight between its corners, constant beyond them.
/// @param corner_x  strictly increasing, at least one  @param corner_y  as many
inline double valueOfBrokenLine(const std::vector<double>& corner_x, const std::vector<double>& corner_y, double x) {
  assert(!corner_x.empty() && corner_x.size() == corner_y.size());
  if (x <= corner_x.front()) return corner_y.front();
  if (x >= corner_x.back()) return corner_y.back();
  const auto next = static_cast<std::size_t>(std::upper_bound(corner_x.begin(), corner_x.end(), x) - corner_x.begin());
  const double share = (x - corner_x[next - 1]) / (corner_x[next] - corner_x[next - 1]);
  return corner_y[next - 1] + share * (corner_y[next] - corner_y[next - 1]);
}

}  // namespace brash_ice_rig
