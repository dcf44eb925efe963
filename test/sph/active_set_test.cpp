#include "brash_ice_rig/sph/active_set.h"

#include <cmath>
#include <limits>
#include <memory>

#include <gtest/gtest.h>

#include "brash_ice_rig/sph/sph_body.h"
#include "elastic_material.h"

namespace brash_ice_rig {
namespace {

constexpr double kSpacing = 0.3, kStep = 0.002;

ActiveSetSettings settings() {
  ActiveSetSettings s;
  s.enabled = true;
  s.quiet_force_n = 1.0;
  s.quiet_way_m = 0.001;
  s.quiet_time_s = 0.1;
  s.spacing_m = kSpacing;
  s.time_step_s = kStep;
  return s;
}

/// Forty particles in a line, five groups; each neighbours the next two on both sides.
struct Line {
  explicit Line(const ActiveSetSettings& s = settings(), bool all_fixed = false) {
    for (int i = 0; i < 40; ++i) position.emplace_back(kSpacing * i, 0.0, 0.0);
    neighbours.row_begin.push_back(0);
    for (int i = 0; i < 40; ++i) {
      for (int j = std::max(0, i - 2); j <= std::min(39, i + 2); ++j) {
        if (j != i) neighbours.index.push_back(j);
      }
      neighbours.row_begin.push_back(neighbours.index.size());
    }
    for (auto& component : stress) component.assign(40, 0.0f);
    set = std::make_unique<ActiveSet>(s, position, std::vector<bool>(40, all_fixed));
    set->setNeighbours(neighbours);
  }

  /// @param force  on each sleeping particle that is watched, N
  void step(float force = 0.0f) {
    if (set->sampling()) {
      for (const auto& run : set->awake()) {
        for (std::size_t i = run.begin; i < run.end; ++i) set->sampleStress(i, stress);
      }
      for (const auto& run : set->watched()) {
        for (std::size_t i = run.begin; i < run.end; ++i) set->sampleForce(i, {0.0f, force, 0.0f, 0.0f});
      }
    }
    set->endStep(position, {1000.0, 0.0}, 1.0, fallen_asleep);
  }
  void rest(double duration_s) {
    for (int k = 0; k < std::lround(duration_s / kStep); ++k) step();
  }

  std::vector<Eigen::Vector3d> position;
  std::array<std::vector<float>, kComponents> stress;
  NeighbourList neighbours;
  std::unique_ptr<ActiveSet> set;
  std::vector<std::size_t> fallen_asleep;
};

TEST(ActiveSet, WhatRestsFallsAsleepAfterTheQuietTimeAndNotBefore) {
  Line line;
  line.rest(0.09);
  EXPECT_EQ(line.set->awakeCount(), 40u);
  line.rest(0.15);
  EXPECT_EQ(line.set->awakeCount(), 0u);
}

TEST(ActiveSet, NoneSleepsUnlessEnabled) {
  ActiveSetSettings s = settings();
  s.enabled = false;
  Line line(s);
  line.rest(1.0);
  EXPECT_EQ(line.set->awakeCount(), 40u);
  EXPECT_FALSE(line.set->sampling());
}

TEST(ActiveSet, OneThatMovesKeepsItsGroupAwake) {
  Line line;
  for (int k = 0; k < 500; ++k) {
    line.position[18].z() += 0.02 * kStep;  // 2 mm in the quiet time
    line.step();
  }
  EXPECT_EQ(line.set->awakeCount(), 8u);
  EXPECT_TRUE(line.set->isAwake(18));
}

TEST(ActiveSet, StressThatDriftsKeepsAwakeAndAWaveDoesNot) {
  Line line;
  // 1 N over (0.3 m)² is 11 Pa: a drift of 150 Pa/s is too much for 0.1 s; a wave of 500 Pa has no mean.
  for (int k = 0; k < 500; ++k) {
    line.stress[1][2] += 150.0f * static_cast<float>(kStep);
    line.stress[4][34] = (k / 2) % 2 == 0 ? 500.0f : -500.0f;
    line.step();
  }
  EXPECT_TRUE(line.set->isAwake(2));
  EXPECT_FALSE(line.set->isAwake(34));
}

TEST(ActiveSet, IceNearTheRigDoesNotSleepAndWakesUpWhenTheRigComes) {
  Line line;
  const auto stepWithRigAt = [&line](double x) {
    if (line.set->sampling()) {
      for (const auto& run : line.set->awake()) {
        for (std::size_t i = run.begin; i < run.end; ++i) line.set->sampleStress(i, line.stress);
      }
    }
    line.set->endStep(line.position, {x, 0.0}, 0.5, line.fallen_asleep);
  };
  for (int k = 0; k < 500; ++k) stepWithRigAt(0.0);
  EXPECT_EQ(line.set->awakeCount(), 8u);
  EXPECT_TRUE(line.set->isAwake(0));
  for (int k = 0; k < 50; ++k) stepWithRigAt(11.0);
  EXPECT_TRUE(line.set->isAwake(36));
}

TEST(ActiveSet, AForceBeyondTheQuietOneWakesTheBorderAndTheGroupsAroundIt) {
  Line line;
  const auto settle = [&line] {
    for (int k = 0; k < 500; ++k) {
      line.position[0].z() += 0.02 * kStep;
      line.step(0.9f);
    }
  };
  settle();
  ASSERT_EQ(line.set->awakeCount(), 8u);  // 0.9 N wakes none
  int steps = 0;
  while (line.set->awakeCount() == 8 && steps < 100) {
    line.step(1.1f);
    ++steps;
  }
  EXPECT_LE(steps, 2);
  EXPECT_EQ(line.set->awakeCount(), 24u);  // group 1 is pushed, group 2 lies around it
  EXPECT_TRUE(line.set->isAwake(8));
  EXPECT_TRUE(line.set->isAwake(16));
  EXPECT_FALSE(line.set->isAwake(24));
}

TEST(ActiveSet, SharesHoldEachRunOnceAndRunsKnowWhereTheirNeighboursAre) {
  // Particles 3, 17 and 30 move, so that three groups with gaps between them stay awake; then all.
  for (const bool all : {false, true}) {
    Line line;
    for (int k = 0; k < (all ? 1 : 500); ++k) {
      for (const std::size_t i : {3u, 17u, 30u}) line.position[i].z() += 0.02 * kStep;
      line.step();
    }
    const auto& awake = line.set->awake();
    ASSERT_EQ(line.set->awakeCount(), all ? 40u : 24u);
    const auto runOf = [&](std::size_t i) {
      std::size_t run = 0;
      while (run < awake.size() && !(i >= awake[run].begin && i < awake[run].end)) ++run;
      return run;
    };
    std::vector<int> completed(awake.size(), 0);
    for (std::size_t run = 0; run < awake.size(); ++run) {
      EXPECT_LE(awake[run].first_neighbour, run);
      EXPECT_GE(awake[run].last_neighbour, run);
      for (std::size_t i = awake[run].begin; i < awake[run].end; ++i) {
        for (std::size_t c = line.neighbours.row_begin[i]; c < line.neighbours.row_begin[i + 1]; ++c) {
          const std::size_t other = runOf(static_cast<std::size_t>(line.neighbours.index[c]));
          if (other == awake.size()) continue;  // asleep
          EXPECT_GE(other, awake[run].first_neighbour);
          EXPECT_LE(other, awake[run].last_neighbour);
        }
      }
      line.set->forRunsCompletedBy(run, [&](std::size_t k) {
        ++completed[k];
        EXPECT_EQ(awake[k].last_neighbour, run);
      });
    }
    for (const int times : completed) EXPECT_EQ(times, 1);
    for (const std::size_t count : {1u, 2u, 3u, 7u}) {
      std::size_t next = 0;
      for (std::size_t k = 0; k < count; ++k) {
        const auto share = line.set->share(k, count);
        EXPECT_EQ(share.begin, next);
        EXPECT_GE(share.end, share.begin);
        next = share.end;
      }
      EXPECT_EQ(next, awake.size());
    }
  }
}

TEST(ActiveSet, AForceThatIsNotANumberWakes) {
  Line line;
  for (int k = 0; k < 500; ++k) {
    line.position[0].z() += 0.02 * kStep;
    line.step();
  }
  ASSERT_FALSE(line.set->isAwake(8));
  for (int k = 0; k < 3; ++k) line.step(std::numeric_limits<float>::quiet_NaN());
  EXPECT_TRUE(line.set->isAwake(8));
}

TEST(ActiveSet, WhatIsWokenFromOutsideTakesPartFromTheNextStepOn) {
  Line line;
  line.rest(1.0);
  ASSERT_EQ(line.set->awakeCount(), 0u);
  line.set->wake(13);
  line.step();
  EXPECT_EQ(line.set->awakeCount(), 8u);
  EXPECT_TRUE(line.set->isAwake(13));
  line.rest(1.0);
  EXPECT_EQ(line.set->awakeCount(), 0u);
}

TEST(ActiveSet, NoForceWakesFixedParticles) {
  Line line(settings(), true);
  for (int k = 0; k < 500; ++k) {
    line.position[0].z() += 0.02 * kStep;
    line.step(1000.0f);
  }
  EXPECT_EQ(line.set->awakeCount(), 8u);
}

// A bar of ice at rest that is struck at one end: the pulse must run through the sleeping ice, and come out as it does
// where all is awake.
TEST(ActiveSet, APulseRunsThroughIceThatWasAsleep) {
  const ElasticMaterial material(7.5e5, 3.5e5);
  std::vector<Eigen::Vector3d> points;
  for (int x = 0; x < 60; ++x) {
    for (int y = 0; y < 4; ++y) {
      for (int z = 0; z < 4; ++z) points.emplace_back(kSpacing * x, kSpacing * y, kSpacing * z);
    }
  }
  SphSettings s;
  s.particle_volume_m3 = std::pow(kSpacing, 3);
  s.density_kgpm3 = 360.0;
  s.smoothing_length_m = 1.2 * kSpacing;
  const auto run = [&](bool sleeps) {
    s.active_set = settings();
    s.active_set.quiet_force_n = 0.01;
    s.active_set.quiet_way_m = 1e-5;
    s.active_set.enabled = sleeps;
    SphBody body(s, material, points, std::vector<bool>(points.size(), false));
    const auto advance = [&body](int steps) {
      for (int k = 0; k < steps; ++k) {
        body.updateGradients();
        body.updateStress(kStep);
        body.updateMotion(kStep, 0.0, [](std::size_t) { return Eigen::Vector4f(Eigen::Vector4f::Zero()); });
      }
    };
    advance(200);
    EXPECT_EQ(body.activeSet().awakeCount(), sleeps ? 0u : points.size());
    // Nobody watches a body that sleeps as a whole: the rig, here at the bar's end, wakes what it is near.
    body.keepAwake({0.0, 0.0}, 2.0);
    advance(40);
    for (std::size_t i = 0; i < 16; ++i) body.setVelocity(i, {0.1, 0.0, 0.0});
    advance(300);  // 0.6 s: at 50 m/s the pulse needs 0.36 s to the far end, and is on its way back
    double way = 0.0;
    for (std::size_t i = points.size() - 16; i < points.size(); ++i) way += (body.position()[i] - points[i]).x() / 16.0;
    return way;
  };
  const double asleep = run(true), awake = run(false);
  EXPECT_GT(awake, 1e-3);
  // The 32 particles that neighbour the awake ones may each hold back 0.01 N for as long as the pulse runs, of 15.6 N
  // s.
  EXPECT_NEAR(asleep, awake, 32.0 * 0.01 * 0.6 / 15.6 * awake);
}

}  // namespace
}  // namespace brash_ice_rig
