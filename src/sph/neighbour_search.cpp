#include "brash_ice_rig/sph/neighbour_search.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

namespace brash_ice_rig {
namespace {

using Cell = std::array<std::int64_t, 3>;

bool isSame(const Cell& a, const Cell& b) {
  return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

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
  return static_cast<std::size_t>(mixed ^ mixed >> 20) & mask;
}

}  // namespace

void findNeighbours(const std::vector<Eigen::Vector3d>& position_m, double radius_m, NeighbourList& list) {
  assert(radius_m > 0.0);
  const std::size_t count = position_m.size();

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

  // All particles of a cell share their 27 cells: these are gathered once, in ascending order, and each row is a
  // selection.
  std::vector<std::size_t> length(count);
  std::vector<std::int32_t> found, around;
  std::vector<std::size_t> found_begin(count);
  std::vector<double> x, y, z;
  std::vector<char> done(count, 0);
  const double radius_squared = radius_m * radius_m;
  found.reserve(64 * count);
  for (std::size_t first = 0; first < count; ++first) {
    if (done[first] != 0) continue;
    const Cell home = cell[first];
    around.clear();
    for (std::int64_t dx = -1; dx <= 1; ++dx) {
      for (std::int64_t dy = -1; dy <= 1; ++dy) {
        for (std::int64_t dz = -1; dz <= 1; ++dz) {
          const Cell wanted{home[0] + dx, home[1] + dy, home[2] + dz};
          const std::size_t bucket = bucketOf(wanted, mask);
          for (std::size_t m = bucket_begin[bucket]; m < bucket_begin[bucket + 1]; ++m) {
            // Cells that share a bucket are told apart here, so that no pair is listed twice.
            if (isSame(cell[static_cast<std::size_t>(member[m])], wanted)) around.push_back(member[m]);
          }
        }
      }
    }
    std::sort(around.begin(), around.end());
    x.resize(around.size());
    y.resize(around.size());
    z.resize(around.size());
    for (std::size_t k = 0; k < around.size(); ++k) {
      const Eigen::Vector3d& position = position_m[static_cast<std::size_t>(around[k])];
      x[k] = position.x();
      y[k] = position.y();
      z[k] = position.z();
    }
    const std::size_t bucket = bucketOf(home, mask);
    for (std::size_t m = bucket_begin[bucket]; m < bucket_begin[bucket + 1]; ++m) {
      const auto i = static_cast<std::size_t>(member[m]);
      if (!isSame(cell[i], home)) continue;
      done[i] = 1;
      found_begin[i] = found.size();
      found.resize(found.size() + around.size());
      std::int32_t* const row = found.data() + found_begin[i];
      const Eigen::Vector3d own = position_m[i];
      std::size_t taken = 0;
      for (std::size_t k = 0; k < around.size(); ++k) {
        const double ox = x[k] - own.x(), oy = y[k] - own.y(), oz = z[k] - own.z();
        row[taken] = around[k];  // written in any case and kept or not: a branch would often be guessed wrong
        taken += (ox * ox + oy * oy + oz * oz < radius_squared) & (around[k] != static_cast<std::int32_t>(i)) ? 1 : 0;
      }
      length[i] = taken;
      found.resize(found_begin[i] + taken);
    }
  }

  list.row_begin.assign(count + 1, 0);
  for (std::size_t i = 0; i < count; ++i) list.row_begin[i + 1] = list.row_begin[i] + length[i];
  list.index.resize(list.row_begin[count]);
  for (std::size_t i = 0; i < count; ++i) {
    std::copy_n(found.data() + found_begin[i], length[i], list.index.data() + list.row_begin[i]);
  }
}

}  // namespace brash_ice_rig
