#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace brash_ice_rig {

/// For each particle all others within a radius, in ascending order, in one array (compressed rows).
struct NeighbourList {
  std::vector<std::size_t> row_begin;  ///< row i is index[row_begin[i]] .. index[row_begin[i + 1] - 1]
  std::vector<std::int32_t> index;
};

/// Cell-grid search. Positions must be finite; particles far outside the rest only cost time.
/// @param radius_m  > 0
void findNeighbours(const std::vector<Eigen::Vector3d>& position_m, double radius_m, NeighbourList& list);

}  // namespace brash_ice_rig
