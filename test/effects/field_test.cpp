// Effects on the field at its creation: void fraction over depth, patches of thickness.

#include <cmath>
#include <numeric>
#include <set>

#include <gtest/gtest.h>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/ice/ice_field.h"
#include "brash_ice_rig/simulation/simulation.h"
#include "effect_bench.h"

namespace brash_ice_rig {
namespace {

struct Field {
  Field(const Scenario& s, const std::string& name, EffectKeys keys)
      : ice(makeIceField(s.field, iceDraft(s))),
        plain(ice),
        volume(ice.position_m.size(), 1.0f),
        solid(ice.position_m.size(), 1.0f) {
    FieldAtCreation creation{s, ice.position_m, volume, solid};
    makeEffect(name, keys, s)->createField(creation);
    bottom_rise_m = creation.bottom_rise_m;
  }

  IceField ice, plain;
  std::vector<float> volume, solid;
  double bottom_rise_m = 0.0;
};

double mean(const std::vector<float>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

std::string refusalOf(const Scenario& s) {
  try {
    s.validate();
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

// ---- porosity_gradient

TEST(PorosityGradient, VoidFractionGrowsWithDepthAndKeepsItsMean) {
  const Scenario s;
  const Field field(s, "porosity_gradient", {{"contrast", 0.4}});
  EXPECT_NEAR(mean(field.solid), 1.0, 1e-6);
  // Four layers of particles, at 1/8, 3/8, 5/8 and 7/8 of the depth: void fractions 0.45, 0.55, 0.65, 0.75.
  const double solid_from_the_bottom[] = {0.25, 0.35, 0.45, 0.55};
  for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(0.4 * field.solid[k], solid_from_the_bottom[k], 1e-6);
}

TEST(PorosityGradient, FieldFloatsInItsOwnEquilibrium) {
  for (const double contrast : {-0.5, 0.5}) {
    Scenario s = smallLift();
    const Field field(s, "porosity_gradient", {{"contrast", contrast}});
    // By hand for four layers: below, ice with more voids lifts less, and the field sinks.
    EXPECT_EQ(field.bottom_rise_m<0.0, contrast> 0.0);
    const ParticleInWater water(s.water, s.ice, s.field.spacing_m);
    double weight = 0.0, buoyancy = 0.0;
    for (std::size_t i = 0; i < field.solid.size(); ++i) {
      const double solid = field.solid[i];
      weight += solid * water.weight();
      buoyancy += solid * water.buoyancy(water.submerged(static_cast<float>(field.ice.position_m[i].z())));
    }
    EXPECT_NEAR(buoyancy / weight, 1.0, 1e-5);

    enable(s, "porosity_gradient", {{"contrast", contrast}});
    s.procedure.control = ControlMode::kManual;
    s.procedure.start_gap_m = 1.0;
    s.procedure.settle_duration_s = 3.0;
    Simulation simulation(s);
    const ParticleCloud before = simulation.particles();
    simulation.advance(4.0);
    const ParticleCloud after = simulation.particles();
    for (std::size_t i = 0; i < after.size(); ++i) EXPECT_NEAR(after.z_m[i], before.z_m[i], 0.01);
  }
}

TEST(PorosityGradient, VoidFractionMustStayAShare) {
  Scenario s;
  enable(s, "porosity_gradient", {{"contrast", 0.85}});
  EXPECT_EQ(
      refusalOf(s),
      "effects.porosity_gradient.contrast = 0.85, must be between -0.8 and 0.8, or the void fraction leaves (0, 1) "
      "at top or bottom");
}

// ---- thickness_field

TEST(ThicknessField, HasPatchesWithTheMeanAndTheDeviationAskedFor) {
  const Scenario s;
  const Field field(s, "thickness_field", {{"sd_ratio", 0.08}, {"patch_m", 3.0}});
  const std::set<float> thicknesses(field.volume.begin(), field.volume.end());
  EXPECT_GE(thicknesses.size(), 5u);
  EXPECT_LE(thicknesses.size(), 36u) << "patches, not columns";
  EXPECT_NEAR(mean(field.volume), 1.0, 1e-6);
  double squares = 0.0;
  for (const float ratio : field.volume) squares += (ratio - 1.0) * (ratio - 1.0);
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(field.volume.size())), 0.08, 1e-6);
  EXPECT_EQ(field.volume, field.solid);
  for (std::size_t i = 0; i < field.volume.size(); ++i) {
    EXPECT_NEAR(field.ice.position_m[i].z(), field.volume[i] * field.plain.position_m[i].z(), 1e-6);
  }
}

TEST(ThicknessField, SeedSelectsThePatches) {
  const Scenario s;
  const Field one(s, "thickness_field", {{"seed", 1.0}}), again(s, "thickness_field", {{"seed", 1.0}}),
      other(s, "thickness_field", {{"seed", 2.0}});
  EXPECT_EQ(one.volume, again.volume);
  EXPECT_NE(one.volume, other.volume);
}

TEST(ThicknessField, FieldFloatsAtRestAndTheRigBeginsBelowItsThickestIce) {
  Scenario s = smallLift();
  enable(s, "thickness_field", {{"sd_ratio", 0.1}, {"patch_m", 1.0}});
  s.procedure.control = ControlMode::kManual;
  s.procedure.settle_duration_s = 3.0;
  Simulation simulation(s);
  EXPECT_LT(simulation.snapshot().rig.hoist_position_m, startHubHeight(s) - 0.01);
  EXPECT_NEAR(simulation.snapshot().ice_force_n.z(), 0.0, 1.0);
  const ParticleCloud before = simulation.particles();
  simulation.advance(4.0);
  const ParticleCloud after = simulation.particles();
  for (std::size_t i = 0; i < after.size(); ++i) EXPECT_NEAR(after.z_m[i], before.z_m[i], 0.02);
}

TEST(ThicknessField, FieldHoldsFivePatches) {
  Scenario s;
  enable(s, "thickness_field", {{"patch_m", 7.0}});
  EXPECT_EQ(refusalOf(s),
            "effects.thickness_field.patch_m = 7, must be at most 6.708, so that the field holds 5 patches");
}

}  // namespace
}  // namespace brash_ice_rig
