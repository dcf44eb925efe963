#pragma once

#include <array>
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

/// Cell-grid search. Keeps its memory from one search to the next.
class NeighbourSearch {
 public:
  /// Called by every thread of an OpenMP team together; from a single thread it works too. Positions must be finite;
  /// particles far outside the rest only cost time.
  /// @param radius_m  > 0
  void find(const std::vector<Eigen::Vector3d>& position_m, double radius_m, NeighbourList& list);

 private:
  using Cell = std::array<std::int64_t, 3>;

  static Cell cellOf(const Eigen::Vector3d& position, double cell_size);
  std::size_t bucketOf(const Cell& cell) const;
  void sortIntoCells(const std::vector<Eigen::Vector3d>& position_m, double cell_size);
  void findRowsOf(std::size_t home, const std::vector<Eigen::Vector3d>& position_m, double radius_squared,
                  std::vector<std::int32_t>& found);

  std::size_t mask_ = 0;  ///< number of buckets less one
  std::vector<Cell> cell_;
  std::vector<std::size_t> bucket_begin_;
  std::vector<std::int32_t> member_;  ///< particles by bucket
  std::vector<std::size_t> home_;     ///< the first particle of each cell
  /// The rows that a thread has found, one after the other. Not one array per cell: each would keep the room that the
  /// fullest cell of all once took under its number.
  std::vector<std::vector<std::int32_t>> rows_of_thread_;
  std::vector<std::size_t> thread_of_home_;
  std::vector<std::size_t> home_of_, row_offset_, row_length_;  ///< per particle: cell, where its row is, how long
};

}  // namespace brash_ice_rig
