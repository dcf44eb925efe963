#include "brash_ice_rig/rig/contact.h"

#include <cmath>

#include <gtest/gtest.h>

#include "../sph/elastic_material.h"

namespace brash_ice_rig {
namespace {

constexpr double kSpacing = 0.3, kStep = 0.0025, kMass = 9.72;

/// One particle near a collector at the origin, with the net flat (no rim) unless said otherwise.
struct Bench {
  explicit Bench(const Eigen::Vector3d& position, double rim_height_m = 0.0) : material(7.5e5, 3.5e5) {
    collector_config.rim_height_m = rim_height_m;
    settings.particle_volume_m3 = kSpacing * kSpacing * kSpacing;
    settings.density_kgpm3 = kMass / settings.particle_volume_m3;
    settings.smoothing_length_m = 0.36;
    body =
        std::make_unique<SphBody>(settings, material, std::vector<Eigen::Vector3d>{position}, std::vector<bool>{false});
    collector = std::make_unique<Collector>(collector_config, true);
    contact = std::make_unique<RigContact>(config, collector_config, 7.5e5, kSpacing, kMass, 1);
  }
  ContactSum update(const Eigen::Vector3d& hub = Eigen::Vector3d::Zero(),
                    const Eigen::Vector3d& hub_velocity = Eigen::Vector3d::Zero()) {
    return contact->update(kStep, *body, *collector, hub, hub_velocity);
  }

  CollectorConfig collector_config;
  ContactConfig config;
  SphSettings settings;
  ElasticMaterial material;
  std::unique_ptr<SphBody> body;
  std::unique_ptr<Collector> collector;
  std::unique_ptr<RigContact> contact;
};

TEST(Friction, FollowsEq4) {
  ContactConfig config;  // 0.57, 0.06, 0.02 s/m
  EXPECT_DOUBLE_EQ(frictionCoefficient(config, 0.0), 0.57);
  EXPECT_NEAR(frictionCoefficient(config, 0.052), 0.5695, 1e-4);
  // The paper's model is in mm: 0.02 s/mm at 52 mm/s.
  config.friction_decay_spm = 20.0;
  EXPECT_NEAR(frictionCoefficient(config, 0.052), 0.06 + 0.51 * std::exp(-1.04), 1e-12);
  EXPECT_NEAR(frictionCoefficient(config, 0.052), 0.24, 0.005);
  EXPECT_NEAR(frictionCoefficient(config, 100.0), 0.06, 1e-12);
}

TEST(Contact, BeginsAtHalfASpacingFromTheNet) {
  EXPECT_EQ(Bench({0.7, 0.1, 0.1501}).update().total().norm(), 0.0);
  EXPECT_GT(Bench({0.7, 0.1, 0.1499}).update().total().norm(), 0.0);
}

TEST(Contact, PushesWithStiffnessTimesPenetrationAndReactsOnTheRig) {
  Bench bench({0.7, 0.1, 0.148});
  const ContactSum sum = bench.update();
  EXPECT_NEAR(bench.contact->normalStiffness(), 5.0e4, 1e-9);  // the lower bound: 0.1 K dx is only 22.5 kN/m
  EXPECT_NEAR(sum.normal_n.z(), -5.0e4 * 0.002, 1e-6);
  EXPECT_NEAR(static_cast<double>(bench.contact->force(0).z()), 100.0, 1e-3);
}

TEST(Contact, ActsFromBothSidesOfTheNet) {
  Bench bench({0.7, 0.1, -0.148});
  EXPECT_NEAR(bench.update().normal_n.z(), 100.0, 1e-6);
}

TEST(Contact, CannotBePassedByPressingThrough) {
  Bench bench({0.7, 0.1, 0.10});
  bench.update();
  // The rig moves up past the particle: it is still pushed up, harder.
  const ContactSum through = bench.update({0.0, 0.0, 0.15});
  EXPECT_NEAR(through.normal_n.z(), -5.0e4 * 0.20, 1e-6);
}

TEST(Contact, DampingActsAgainstApproachAndNeverPulls) {
  Bench bench({0.7, 0.1, 0.149});
  const double damping = 2.0 * 0.2 * std::sqrt(5.0e4 * kMass);
  EXPECT_NEAR(bench.update({0, 0, 0}, {0, 0, 0.05}).normal_n.z(), -(5.0e4 * 0.001 + damping * 0.05), 1e-6);
  EXPECT_EQ(bench.update({0, 0, 0}, {0, 0, -5.0}).normal_n.z(), 0.0);
}

TEST(Contact, FrictionGrowsAsASpringAndSlipsAtMu) {
  Bench bench({0.7, 0.1, 0.148});
  const double normal = 100.0, mu = 0.57;
  const Eigen::Vector3d sideways(0.004, 0.0, 0.0);  // of the rig: the particle lags behind
  bench.config.friction_decay_spm = 0.0;
  bench.contact = std::make_unique<RigContact>(bench.config, bench.collector_config, 7.5e5, kSpacing, kMass, 1);
  const ContactSum first = bench.update({0, 0, 0}, sideways);
  EXPECT_NEAR(first.friction_n.x(), -0.5 * 5.0e4 * 0.004 * kStep, 1e-9);  // ice holds the rig back
  ContactSum last;
  for (int k = 0; k < 2000; ++k) last = bench.update({0, 0, 0}, sideways);
  EXPECT_NEAR(last.friction_n.x(), -mu * normal, 1e-6);
}

TEST(Contact, FrictionHoldsAtStandstillAndIsForgottenWhenContactEnds) {
  Bench bench({0.7, 0.1, 0.148});
  for (int k = 0; k < 100; ++k) bench.update({0, 0, 0}, {0.01, 0.0, 0.0});
  EXPECT_LT(bench.update().friction_n.x(), -1.0);
  bench.update({0.0, 0.0, -1.0});
  EXPECT_EQ(bench.update().friction_n.norm(), 0.0);
}

TEST(Contact, ParticleBeyondTheRimIsPushedOutwards) {
  Bench bench({1.3 * std::cos(M_PI / 8.0) * std::cos(M_PI / 8.0) + 0.1,
               1.3 * std::cos(M_PI / 8.0) * std::sin(M_PI / 8.0), 0.0});
  bench.update();
  EXPECT_GT(bench.contact->force(0).x(), 0.0f);
  EXPECT_NEAR(bench.contact->force(0).z(), 0.0f, 1e-3f);
}

TEST(Contact, PolePushesSidewaysOnly) {
  Bench bench({0.19, 0.0, 1.0});
  const ContactSum sum = bench.update();
  EXPECT_NEAR(sum.normal_n.x(), -5.0e4 * 0.01, 1e-6);
  EXPECT_EQ(sum.normal_n.z(), 0.0);
  // No pole below the hub.
  EXPECT_EQ(Bench({0.19, 0.0, -1.0}).update().total().norm(), 0.0);
}

TEST(Contact, LoadOnTheNetOpensTheArmsWithItsLever) {
  // Flat net: 100 N down at a distance of 0.7 m along the facet's middle, where the arm turns by cos of half a sector.
  const double a = M_PI / 8.0;
  Bench bench({0.7 * std::cos(a), 0.7 * std::sin(a), 0.148});
  EXPECT_NEAR(bench.update().opening_moment_nm, 100.0 * 0.7 / std::cos(a), 1e-3);
}

TEST(Contact, NoIceNearTheRigGivesZeroForce) {
  Bench bench({3.0, 0.0, 0.1}, 0.3);
  const ContactSum sum = bench.update();
  EXPECT_EQ(sum.total().norm(), 0.0);
  EXPECT_EQ(sum.deepest_m, 0.0);
}

}  // namespace
}  // namespace brash_ice_rig
