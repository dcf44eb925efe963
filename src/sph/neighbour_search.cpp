#include "brash_ice_rig/sph/neighbour_search.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include <omp.h>

namespace brash_ice_rig {
namespace {

bool isSame(const std::array<std::int64_t, 3>& a, const std::array<std::int64_t, 3>& b) {
  return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

}  // namespace

NeighbourSearch::Cell NeighbourSearch::cellOf(const Eigen::Vector3d& position, double cell_size) {
  constexpr double kFarthest = 1.0e15;  // beyond, particles share a cell: slower, still right
  Cell cell;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double coordinate = std::floor(position[static_cast<Eigen::Index>(axis)] / cell_size);
    cell[axis] = static_cast<std::int64_t>(std::clamp(coordinate, -kFarthest, kFarthest));
  }
  return cell;
}

/// Hashed, not a box of cells: a single particle that flies off must not make the grid huge.
std::size_t NeighbourSearch::bucketOf(const Cell& cell) const {
  const auto mixed = static_cast<std::uint64_t>(cell[0]) * 73856093u ^ static_cast<std::uint64_t>(cell[1]) * 19349663u ^
                     static_cast<std::uint64_t>(cell[2]) * 83492791u;
  return static_cast<std::size_t>(mixed ^ mixed >> 20) & mask_;
}

void NeighbourSearch::sortIntoCells(const std::vector<Eigen::Vector3d>& position_m, double cell_size) {
  const std::size_t count = position_m.size();
  std::size_t buckets = 64;
  while (buckets < count) buckets *= 2;
  mask_ = buckets - 1;
  cell_.resize(count);
  bucket_begin_.assign(buckets + 1, 0);
  for (std::size_t i = 0; i < count; ++i) {
    cell_[i] = cellOf(position_m[i], cell_size);
    ++bucket_begin_[bucketOf(cell_[i]) + 1];
  }
  for (std::size_t b = 0; b < buckets; ++b) bucket_begin_[b + 1] += bucket_begin_[b];
  member_.resize(count);
  std::vector<std::size_t> cursor(bucket_begin_.begin(), bucket_begin_.end() - 1);
  home_.clear();
  home_of_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t bucket = bucketOf(cell_[i]);
    std::size_t m = bucket_begin_[bucket];
    while (m < cursor[bucket] && !isSame(cell_[static_cast<std::size_t>(member_[m])], cell_[i])) ++m;
    if (m == cursor[bucket]) {
      home_of_[i] = home_.size();
      home_.push_back(i);
    } else {
      home_of_[i] = home_of_[static_cast<std::size_t>(member_[m])];
    }
    member_[cursor[bucket]++] = static_cast<std::int32_t>(i);
  }
  thread_of_home_.resize(home_.size());
  row_offset_.resize(count);
  row_length_.resize(count);
}

/// All particles of a cell share their 27 cells: these are gathered once, in ascending order, and each row is a
/// selection.
void NeighbourSearch::findRowsOf(std::size_t home, const std::vector<Eigen::Vector3d>& position_m,
                                 double radius_squared, std::vector<std::int32_t>& found) {
  const Cell centre = cell_[home_[home]];
  std::vector<std::int32_t> around;
  for (std::int64_t dx = -1; dx <= 1; ++dx) {
    for (std::int64_t dy = -1; dy <= 1; ++dy) {
      for (std::int64_t dz = -1; dz <= 1; ++dz) {
        const Cell wanted{centre[0] + dx, centre[1] + dy, centre[2] + dz};
        const std::size_t bucket = bucketOf(wanted);
        for (std::size_t m = bucket_begin_[bucket]; m < bucket_begin_[bucket + 1]; ++m) {
          // Cells that share a bucket are told apart here, so that no pair is listed twice.
          if (isSame(cell_[static_cast<std::size_t>(member_[m])], wanted)) around.push_back(member_[m]);
        }
      }
    }
  }
  std::sort(around.begin(), around.end());
  std::vector<double> x(around.size()), y(around.size()), z(around.size()), squared(around.size());
  for (std::size_t k = 0; k < around.size(); ++k) {
    const Eigen::Vector3d& position = position_m[static_cast<std::size_t>(around[k])];
    x[k] = position.x();
    y[k] = position.y();
    z[k] = position.z();
  }
  const std::size_t bucket = bucketOf(centre);
  for (std::size_t m = bucket_begin_[bucket]; m < bucket_begin_[bucket + 1]; ++m) {
    const auto i = static_cast<std::size_t>(member_[m]);
    if (home_of_[i] != home) continue;
    row_offset_[i] = found.size();
    found.resize(found.size() + around.size());
    std::int32_t* const row = found.data() + row_offset_[i];
    const Eigen::Vector3d& own = position_m[i];
    for (std::size_t k = 0; k < around.size(); ++k) {
      const double ox = x[k] - own.x(), oy = y[k] - own.y(), oz = z[k] - own.z();
      squared[k] = ox * ox + oy * oy + oz * oz;
    }
    std::size_t taken = 0;
    for (std::size_t k = 0; k < around.size(); ++k) {
      row[taken] = around[k];  // written in any case and kept or not: a branch would often be guessed wrong
      const bool near = squared[k] < radius_squared, other = around[k] != static_cast<std::int32_t>(i);
      taken += static_cast<std::size_t>(near & other);
    }
    row_length_[i] = taken;
    found.resize(row_offset_[i] + taken);
  }
}

void NeighbourSearch::find(const std::vector<Eigen::Vector3d>& position_m, double radius_m, NeighbourList& list) {
  assert(radius_m > 0.0);
  const std::size_t count = position_m.size();
#pragma omp single
  {
    sortIntoCells(position_m, radius_m);
    rows_of_thread_.resize(static_cast<std::size_t>(omp_get_num_threads()));
  }
  const auto thread = static_cast<std::size_t>(omp_get_thread_num());
  rows_of_thread_[thread].clear();
#pragma omp for schedule(static)
  for (std::size_t home = 0; home < home_.size(); ++home) {
    thread_of_home_[home] = thread;
    findRowsOf(home, position_m, radius_m * radius_m, rows_of_thread_[thread]);
  }
#pragma omp single
  {
    list.row_begin.assign(count + 1, 0);
    for (std::size_t i = 0; i < count; ++i) list.row_begin[i + 1] = list.row_begin[i] + row_length_[i];
    list.index.resize(list.row_begin[count]);
  }
#pragma omp for schedule(static)
  for (std::size_t i = 0; i < count; ++i) {
    std::copy_n(rows_of_thread_[thread_of_home_[home_of_[i]]].data() + row_offset_[i], row_length_[i],
                list.index.data() + list.row_begin[i]);
  }
}

}  // namespace brash_ice_rig
