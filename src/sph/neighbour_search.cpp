#include "brash_ice_rig/sph/neighbour_search.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

namespace brash_ice_rig {
namespace {

using Cell = std::array<std::int64_t, 3>;

Cell cellOf(const Eigen::Vector3d& position, double cell_size) {
  constexpr double kFarthest = 1.0e15;  // beyond, particles share a cell: slower, still right
  Cell cell;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double coordinate = std::floor(position[static_cast<Eigen::Index>(axis)] / cell_size);
    cell[axis] = static_cast<std::int64_t>(std::clamp(coordinate, -kFarthest, kFarthest));
  }
  return cell;
}

/// Hashed, not a box of cells: a single particle that flies off must not make the grid huge.
std::size_t bucketOf(const Cell& cell, std::size_t mask) {
  const auto mixed = static_cast<std::uint64_t>(cell[0]) * 73856093u ^ static_cast<std::uint64_t>(cell[1]) * 19349663u ^
                     static_cast<std::uint64_t>(cell[2]) * 83492791u;
  return static_cast<std::size_t>(mixed) & mask;
}

}  // namespace

void findNeighbours(const std::vector<Eigen::Vector3d>& position_m, double radius_m, NeighbourList& list) {
  assert(radius_m > 0.0);
  const std::size_t count = position_m.size();
  list.row_begin.assign(count + 1, 0);
  list.index.clear();

  std::size_t buckets = 64;
  while (buckets < count) buckets *= 2;
  const std::size_t mask = buckets - 1;

  std::vector<Cell> cell(count);
  std::vector<std::size_t> bucket_begin(buckets + 1, 0);
  for (std::size_t i = 0; i < count; ++i) {
    cell[i] = cellOf(position_m[i], radius_m);
    ++bucket_begin[bucketOf(cell[i], mask) + 1];
  }
  for (std::size_t b = 0; b < buckets; ++b) bucket_begin[b + 1] += bucket_begin[b];
  std::vector<std::int32_t> member(count);
  std::vector<std::size_t> cursor(bucket_begin.begin(), bucket_begin.end() - 1);
  for (std::size_t i = 0; i < count; ++i) member[cursor[bucketOf(cell[i], mask)]++] = static_cast<std::int32_t>(i);

  const double radius_squared = radius_m * radius_m;
  for (std::size_t i = 0; i < count; ++i) {
    const auto row = static_cast<std::ptrdiff_t>(list.index.size());
    for (std::int64_t x = -1; x <= 1; ++x) {
      for (std::int64_t y = -1; y <= 1; ++y) {
        for (std::int64_t z = -1; z <= 1; ++z) {
          const Cell wanted{cell[i][0] + x, cell[i][1] + y, cell[i][2] + z};
          const std::size_t bucket = bucketOf(wanted, mask);
          for (std::size_t m = bucket_begin[bucket]; m < bucket_begin[bucket + 1]; ++m) {
            const auto j = static_cast<std::size_t>(member[m]);
            // Cells that share a bucket are told apart here, so that no pair is listed twice.
            if (j != i && cell[j] == wanted && (position_m[i] - position_m[j]).squaredNorm() < radius_squared) {
              list.index.push_back(member[m]);
            }
          }
        }
      }
    }
    std::sort(list.index.begin() + row, list.index.end());
    list.row_begin[i + 1] = list.index.size();
  }
}

}  // namespace brash_ice_rig
