#include "brash_ice_rig/sph/neighbour_search.h"

#include <malloc.h>

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

std::vector<Eigen::Vector3d> randomCloud(std::size_t count, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> along(-2.0, 2.0);
  std::vector<Eigen::Vector3d> points(count);
  for (auto& p : points) p << along(generator), along(generator), 0.3 * along(generator);
  return points;
}

void expectSameAsBruteForce(const std::vector<Eigen::Vector3d>& points, double radius) {
  NeighbourList list;
  NeighbourSearch().find(points, radius, list);
  ASSERT_EQ(list.row_begin.size(), points.size() + 1);
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::vector<std::int32_t> expected;
    for (std::size_t j = 0; j < points.size(); ++j) {
      if (j != i && (points[i] - points[j]).squaredNorm() < radius * radius) {
        expected.push_back(static_cast<std::int32_t>(j));
      }
    }
    const std::vector<std::int32_t> found(list.index.begin() + static_cast<std::ptrdiff_t>(list.row_begin[i]),
                                          list.index.begin() + static_cast<std::ptrdiff_t>(list.row_begin[i + 1]));
    ASSERT_EQ(found, expected) << "particle " << i;
  }
}

TEST(NeighbourSearch, FindsThePairsThatComparingAllFinds) {
  expectSameAsBruteForce(randomCloud(700, 1), 0.45);
}

TEST(NeighbourSearch, StaysExactWhenOneParticleIsFarAway) {
  auto points = randomCloud(200, 2);
  points.push_back({5.0e4, -3.0e5, 1.0e3});
  expectSameAsBruteForce(points, 0.45);
}

TEST(NeighbourSearch, HandlesNoParticleAndOneParticle) {
  expectSameAsBruteForce({}, 1.0);
  expectSameAsBruteForce({{1.0, 2.0, 3.0}}, 1.0);
}

TEST(NeighbourSearch, CubicLatticeHas56NeighboursWithin2Point4Spacings) {
  std::vector<Eigen::Vector3d> points;
  for (int x = 0; x < 7; ++x)
    for (int y = 0; y < 7; ++y)
      for (int z = 0; z < 7; ++z) points.emplace_back(x, y, z);
  NeighbourList list;
  NeighbourSearch().find(points, 2.4, list);
  const std::size_t centre = (3 * 7 + 3) * 7 + 3;
  EXPECT_EQ(list.row_begin[centre + 1] - list.row_begin[centre], 56u);
}

#if __GLIBC_PREREQ(2, 33)
/// Taken from the heap, bytes; 0 under sanitizers, which have a heap of their own.
std::size_t heapInUse() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

TEST(NeighbourSearch, KeepsNoRoomForCrowdsThatHaveMovedOn) {
  constexpr int kSide = 20;
  std::vector<Eigen::Vector3d> points;
  for (int x = 0; x < kSide; ++x)
    for (int y = 0; y < kSide; ++y) points.emplace_back(x + 0.5, y + 0.5, 0.5);
  const std::size_t lattice = points.size();
  points.resize(lattice + 150);
  NeighbourSearch search;
  NeighbourList list;
  std::size_t at_first = 0;
  for (std::size_t cell = 0; cell < lattice; ++cell) {
    std::fill(points.begin() + static_cast<std::ptrdiff_t>(lattice), points.end(), points[cell]);
    search.find(points, 1.0, list);
    if (cell == 0) at_first = heapInUse();
  }
  EXPECT_LT(static_cast<double>(heapInUse()) - static_cast<double>(at_first), 1.0e6)
      << "an array per cell would have grown by 35 MB";
}
#endif

TEST(NeighbourSearch, FindsTheSameAgainAndWithAnyNumberOfThreads) {
  NeighbourSearch search;
  NeighbourList first, again;
  search.find(randomCloud(900, 4), 0.4, first);
  search.find(randomCloud(50, 5), 1.0, again);  // leaves its memory in another state
  for (const int threads : {1, 2, 5}) {
    const auto points = randomCloud(900, 4);
#pragma omp parallel num_threads(threads)
    search.find(points, 0.4, again);
    EXPECT_EQ(again.row_begin, first.row_begin);
    EXPECT_EQ(again.index, first.index);
  }
}

}  // namespace
}  // namespace brash_ice_rig
