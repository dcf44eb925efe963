#include "brash_ice_rig/config/scenario.h"

#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "brash_ice_rig/config/config_error.h"

namespace brash_ice_rig {
namespace {

/// What validate() says of the default scenario after a change; empty: it is content.
std::string verdict(const std::function<void(Scenario&)>& change) {
  Scenario scenario;
  change(scenario);
  try {
    scenario.validate();
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(Scenario, DefaultIsValid) {
  EXPECT_EQ(verdict([](Scenario&) {}), "");
}

TEST(Scenario, RangesHoldForValuesSetInCodeToo) {
  EXPECT_EQ(verdict([](Scenario& s) { s.ice.void_fraction = 1.0; }), "ice.void_fraction = 1, must lie in (0, 1)");
  EXPECT_EQ(verdict([](Scenario& s) { s.field.spacing_m = 0.0; }), "field.spacing_m = 0, must lie in (0, 5]");
  EXPECT_EQ(verdict([](Scenario& s) { s.field.spacing_m = -0.3; }), "field.spacing_m = -0.3, must lie in (0, 5]");
  EXPECT_EQ(verdict([](Scenario& s) { s.ice.shear_slope = 0.6; }), "ice.shear_slope = 0.6, must lie in (0, 0.57]");
  EXPECT_EQ(verdict([](Scenario& s) { s.solver.threads = 0; }), "solver.threads = 0, must lie in [1, 256]");
  EXPECT_EQ(verdict([](Scenario& s) { s.water.drag_coefficient = std::nan(""); }),
            "water.drag_coefficient = nan, must be a finite number");
  EXPECT_EQ(verdict([](Scenario& s) { s.load_cell.bias_n = -std::numeric_limits<double>::infinity(); }),
            "load_cell.bias_n = -inf, must be a finite number");
}

TEST(Scenario, FieldIsAtLeastOneLayerThick) {
  EXPECT_EQ(verdict([](Scenario& s) { s.field.thickness_m = 0.29; }),
            "field.thickness_m = 0.29, must be at least one field.spacing_m (0.3)");
  EXPECT_EQ(verdict([](Scenario& s) { s.field.thickness_m = 0.3; }), "");
}

TEST(Scenario, FieldHasRoomInsideItsFixedEdge) {
  const std::string rule = "must be at least 5 times field.spacing_m (0.3)";
  EXPECT_EQ(verdict([](Scenario& s) { s.field.length_x_m = 1.49; }), "field.length_x_m = 1.49, " + rule);
  EXPECT_EQ(verdict([](Scenario& s) { s.field.length_y_m = 1.49; }), "field.length_y_m = 1.49, " + rule);
  EXPECT_EQ(verdict([](Scenario& s) {
              s.field.length_x_m = s.field.length_y_m = 5 * 0.3;
              s.collector.radius_m = 0.15;
            }),
            "");
}

TEST(Scenario, CollectorFitsIntoTheField) {
  EXPECT_EQ(verdict([](Scenario& s) { s.collector.radius_m = 7.0; }),
            "collector.radius_m = 7, must be at most 6.9: half of the field's shorter side (7.5) less 2 times "
            "field.spacing_m");
  EXPECT_EQ(
      verdict([](Scenario& s) { s.field.length_y_m = 3.6; }).rfind("collector.radius_m = 1.3, must be at most 1.2", 0),
      0u);
  EXPECT_EQ(verdict([](Scenario& s) { s.collector.radius_m = 6.9; }), "");
}

TEST(Scenario, FoldedArmsStandSteeperThanUnfoldedOnes) {
  EXPECT_EQ(verdict([](Scenario& s) {
              s.collector.radius_m = 1.0;
              s.collector.rim_height_m = 1.0;
              s.collector.folded_arm_angle_deg = 45.0;
            }),
            "collector.folded_arm_angle_deg = 45, must be greater than the unfolded arm's angle "
            "atan(rim_height_m / radius_m) = 45");
  EXPECT_EQ(verdict([](Scenario& s) {
              s.collector.radius_m = 1.0;
              s.collector.rim_height_m = 1.0;
              s.collector.folded_arm_angle_deg = 46.0;
            }),
            "");
}

TEST(Scenario, PoleInTheIcePushesAsideOneLayerAtMost) {
  EXPECT_EQ(verdict([](Scenario& s) { s.collector.pole_radius_m = 0.31; }),
            "collector.pole_radius_m = 0.31, must be at most field.spacing_m (0.3) when the procedure starts under "
            "the ice");
  EXPECT_EQ(verdict([](Scenario& s) {
              s.collector.pole_radius_m = 0.31;
              s.procedure.start = StartPose::kFoldedAboveIce;
            }),
            "");
}

TEST(Scenario, DraftIsThatOfTheLayersThereAre) {
  Scenario s;
  s.field.thickness_m = 1.3;  // four layers of 0.3 m
  EXPECT_NEAR(iceDraft(s), 1.08, 1e-12);
}

TEST(Scenario, IceFloats) {
  EXPECT_EQ(verdict([](Scenario& s) { s.ice.parent_density_kgpm3 = 1000.0; }),
            "ice.parent_density_kgpm3 = 1000, must be less than water.density_kgpm3 (1000), or the ice sinks");
  EXPECT_EQ(verdict([](Scenario& s) { s.water.density_kgpm3 = 890.0; }).rfind("ice.parent_density_kgpm3 = 900", 0), 0u);
  EXPECT_EQ(verdict([](Scenario& s) { s.ice.parent_density_kgpm3 = 999.0; }), "");
}

TEST(Scenario, FrictionDoesNotRiseWithSpeed) {
  EXPECT_EQ(verdict([](Scenario& s) { s.contact.friction_static = 0.05; }),
            "contact.friction_dynamic = 0.06, must be at most contact.friction_static (0.05)");
  EXPECT_EQ(verdict([](Scenario& s) { s.contact.friction_static = 0.06; }), "");
}

TEST(Scenario, CraneHasTravel) {
  EXPECT_EQ(verdict([](Scenario& s) { s.crane.min_height_m = s.crane.max_height_m; }),
            "crane.min_height_m = 12, must be less than crane.max_height_m (12)");
}

TEST(Scenario, CraneHoldsTheStart) {
  // B-1: hub 1.08 m + 0.3 m under water, pole 6 m.
  EXPECT_EQ(
      verdict([](Scenario& s) { s.crane.max_height_m = 4.6; }),
      "crane.max_height_m = 4.6, must be at least 4.62 to hold the rig at the start (hub at -1.38 m, pole of 6 m)");
  EXPECT_EQ(
      verdict([](Scenario& s) { s.crane.min_height_m = 4.7; }),
      "crane.min_height_m = 4.7, must be at most 4.62 to hold the rig at the start (hub at -1.38 m, pole of 6 m)");
  EXPECT_EQ(verdict([](Scenario& s) { s.crane.min_height_m = 4.62; }), "");
}

TEST(Scenario, CraneHoldsTheEndOfTheLift) {
  // 40 s at 0.052 m/s are 2.08 m.
  EXPECT_EQ(verdict([](Scenario& s) { s.crane.max_height_m = 6.69; }),
            "crane.max_height_m = 6.69, must be at least 6.7 to hold the rig at the end of the lift "
            "(hub at 0.7 m, pole of 6 m)");
  EXPECT_EQ(verdict([](Scenario& s) { s.crane.max_height_m = 6.7; }), "");
}

TEST(Scenario, CraneHoldsTheEndOfLowering) {
  const auto folded = [](double min_height) {
    return [min_height](Scenario& s) {
      s.procedure.start = StartPose::kFoldedAboveIce;
      s.crane.min_height_m = min_height;
    };
  };
  // 1.08 m draft, 1.3342 m of arm at 80 degrees, 0.2 m of clearance: hub at -2.594 m.
  EXPECT_EQ(verdict(folded(3.5)),
            "crane.min_height_m = 3.5, must be at most 3.406 to hold the rig at the end of lowering "
            "(hub at -2.594 m, pole of 6 m)");
  EXPECT_EQ(verdict(folded(3.406)), "");
}

TEST(Scenario, CraneReachesTheSpeedsOfTheScript) {
  EXPECT_EQ(verdict([](Scenario& s) {
              s.procedure.lift_speed_mps = 0.51;
              s.procedure.lift_duration_s = 1.0;
            }),
            "procedure.lift_speed_mps = 0.51, must be at most crane.max_speed_mps (0.5)");
  EXPECT_EQ(verdict([](Scenario& s) {
              s.procedure.start = StartPose::kFoldedAboveIce;
              s.procedure.lower_speed_mps = 0.6;
            }),
            "procedure.lower_speed_mps = 0.6, must be at most crane.max_speed_mps (0.5)");
  EXPECT_EQ(verdict([](Scenario& s) { s.crane.max_speed_mps = 0.1; }), "") << "nothing is lowered";
}

TEST(Scenario, ManualControlNeedsOnlyTheStart) {
  const auto manual = [](double max_height) {
    return [max_height](Scenario& s) {
      s.procedure.control = ControlMode::kManual;
      s.procedure.lift_speed_mps = 1.0;
      s.crane.max_height_m = max_height;
    };
  };
  EXPECT_EQ(verdict(manual(4.62)), "");
  EXPECT_EQ(verdict(manual(4.6)).rfind("crane.max_height_m = 4.6, must be at least 4.62", 0), 0u);
}

TEST(Scenario, FieldBeyondMemoryIsRefusedWithTheEstimate) {
  const std::string text = verdict([](Scenario& s) {
    s.field.length_x_m = s.field.length_y_m = 1000.0;
    s.field.thickness_m = 20.0;
    s.field.spacing_m = 0.25;
  });
  // 4000 x 4000 x 80 particles of 3759 bytes; no machine that runs these tests has 4.8 TB.
  EXPECT_EQ(
      text.rfind(
          "field.spacing_m = 0.25, makes 1280 million particles, which need about 4810.969 GB of memory, but only ", 0),
      0u)
      << text;
  EXPECT_NE(text.find(" GB are free; choose a larger spacing or a smaller field"), std::string::npos) << text;
}

TEST(Scenario, WiderNeighbourhoodsNeedMoreMemory) {
  // Measured in fields of 20,000 particles, whose edges have fewer neighbours: 2.0 kB, 5.9 kB, 8.9 kB.
  SolverConfig solver;
  EXPECT_GT(bytesPerParticle(solver), 2017.0);
  solver.smoothing_ratio = 2.0;
  EXPECT_GT(bytesPerParticle(solver), 5924.0);
  solver.neighbour_skin_ratio = 1.0;
  EXPECT_GT(bytesPerParticle(solver), 8887.0);
}

TEST(Scenario, NeighbourhoodsThatMayGrowNeedMoreMemory) {
  // At the limit of 1.5 supports grow by its cube root, 1.145: (2.4 x 1.1447 + 0.4)^3 neighbours instead of 2.8^3.
  SolverConfig solver;
  const double constant = bytesPerParticle(solver) - 1000.0;
  solver.smoothing_length = SmoothingLength::kVariable;
  EXPECT_NEAR((bytesPerParticle(solver) - 1000.0) / constant, 1.4202, 1e-3);
}

TEST(ConfigErrorText, OverlongPartsAreCutBetweenCharacters) {
  const std::string umlauts = [] {
    std::string text = "x";
    for (int i = 0; i < 5000; ++i) text += "\u00e4";
    return text;
  }();
  const ConfigError error(umlauts, umlauts, "must be short", "file.yaml:1");
  const std::string text = error.what();
  EXPECT_LT(text.size(), 800u);
  EXPECT_EQ(text.rfind("file.yaml:1: x\u00e4", 0), 0u);
  EXPECT_NE(text.find("\u00e4... (10001 characters)"), std::string::npos) << text;
  EXPECT_NE(text.find("must be short"), std::string::npos);
  EXPECT_EQ(error.key(), umlauts);
}

TEST(Scenario, FieldBeyondCountingIsRefused) {
  EXPECT_EQ(verdict([](Scenario& s) { s.field.spacing_m = 1.0e-5; }),
            "field.spacing_m = 1.0e-05, makes 2.7e+11 million particles, at most 2147.484 million can be numbered; "
            "choose a larger spacing or a smaller field");
  EXPECT_NE(verdict([](Scenario& s) { s.field.spacing_m = 1.0e-300; }).find("can be numbered"), std::string::npos);
}

TEST(Scenario, CountsTheParticlesOfTable3) {
  EXPECT_EQ(sitesAlong(15.0, 0.3), 50.0);
  EXPECT_EQ(sitesAlong(1.2, 0.3), 4.0);
  EXPECT_EQ(particleCount(FieldConfig()), 10000.0);
}

TEST(Scenario, ShearSurfaceIsAlwaysFlatterThanTheTensionCutoff) {
  // theta < 1/sqrt(3), or the cone has no triaxial limit; the ranges alone must see to that.
  struct Bounds {
    double slope = 0.0, angle_deg = 0.0;
    void operator()(const char* name, std::optional<double>&, const Range& range, const char*) {
      if (std::string(name) == "shear_slope") slope = range.max;
    }
    void operator()(const char* name, double&, const Range& range, const char*) {
      if (std::string(name) == "friction_angle_deg") angle_deg = range.max;
    }
    void operator()(const char*, bool&, const char*) {}
    void operator()(const char*, std::string&, const char*) {}
    void operator()(const char*, FlowRule&, std::initializer_list<const char*>, const char*) {}
  } bounds;
  IceConfig().visit(bounds);
  const double sine = std::sin(bounds.angle_deg * std::acos(-1.0) / 180.0);
  ASSERT_GT(sine, 0.5);
  ASSERT_GT(bounds.slope, 0.0);
  EXPECT_LT(bounds.slope, 1.0 / std::sqrt(3.0));
  EXPECT_LT(2.0 * sine / (std::sqrt(3.0) * (3.0 - sine)), 1.0 / std::sqrt(3.0));  // eq. 10
}

TEST(RigHeights, FollowFromDraftAndArms) {
  Scenario scenario;
  EXPECT_DOUBLE_EQ(iceDraft(scenario), 1.08);
  EXPECT_DOUBLE_EQ(armLength(scenario.collector), std::sqrt(1.3 * 1.3 + 0.3 * 0.3));
  EXPECT_NEAR(std::tan(unfoldedArmAngle(scenario.collector)), 0.3 / 1.3, 1e-15);

  scenario.procedure.start_gap_m = 0.1;
  EXPECT_NEAR(startHubHeight(scenario), -1.48, 1e-12);
  EXPECT_NEAR(lowestHubHeight(scenario), -1.48, 1e-12);
  EXPECT_NEAR(liftEndHubHeight(scenario), 0.6, 1e-12);

  scenario.procedure.start = StartPose::kFoldedAboveIce;
  scenario.collector.rim_height_m = 0.0;
  scenario.collector.folded_arm_angle_deg = 60.0;
  EXPECT_NEAR(startHubHeight(scenario), 0.22, 1e-12);
  EXPECT_NEAR(lowestHubHeight(scenario), -1.08 - 1.3 * std::sqrt(0.75) - 0.2, 1e-12);
  EXPECT_NEAR(liftEndHubHeight(scenario), lowestHubHeight(scenario) + 2.08, 1e-12);
}

}  // namespace
}  // namespace brash_ice_rig
