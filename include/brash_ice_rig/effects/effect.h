#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/effects/effect_registry.h"
#include "brash_ice_rig/system/state_visitor.h"
#include "brash_ice_rig/water/water.h"

namespace brash_ice_rig {

/// The field before anything has moved.
struct FieldAtCreation {
  const Scenario& scenario;
  std::vector<Eigen::Vector3d>& position_m;  ///< frame map; may be changed
  /// Rest volume over spacing³, and mass of ice over the mean particle's. All 1 at first; empty without changes_mass.
  std::vector<float>& volume_ratio;
  std::vector<float>& solid_ratio;
  /// How far the deepest ice over the collector lies above where the plain field's bottom is, m. The rig starts that
  /// much higher.
  double bottom_rise_m = 0.0;
};

/// The ice at the end of a step.
struct IceNow {
  double time_s;                               ///< 0 at the end of settling and rest
  double time_step_s;                          ///< > 0
  const std::vector<Eigen::Vector3d>& site_m;  ///< original positions
  const std::vector<Eigen::Vector3d>& position_m;
  const std::vector<float>& plastic_strain;  ///< accumulated, see CapModel
  const std::vector<float>& pore_volume_m3;  ///< of the undisturbed particle; empty without changes_mass
  double particle_mass_kg;                   ///< ice in the mean particle
  const ParticleInWater& water;
  Eigen::Vector3d hub_position_m;
};

/// What effects may change of the ice. An array is empty where no enabled effect asked for it.
struct IceChanges {
  /// Yield stress over that of the scenario, > 0; 1 again before each step's first effect. The whole yield surface
  /// grows with it: see ScaledStrength.
  std::vector<float> strength_ratio;
  /// Mass of ice over the mean particle's, > 0: weight, buoyancy, drag and inertia go with it. Kept from step to step.
  std::vector<float> solid_ratio;
  /// Water that is carried in pores above the waterline, kg: weight and inertia. Kept from step to step.
  std::vector<float> held_water_kg;

  void visitState(StateVisitor& visitor) {
    visitor("strength_ratio", strength_ratio);
    visitor("solid_ratio", solid_ratio);
    visitor("held_water_kg", held_water_kg);
  }
};

/// Rig and crane in the middle of a step.
struct RigNow {
  double time_s = 0.0;                                           ///< at the end of the step; 0 after settling and rest
  double time_step_s = 0.0;                                      ///< > 0
  Eigen::Vector3d crane_velocity_mps = Eigen::Vector3d::Zero();  ///< of the crane itself, without effects
  Eigen::Vector3d crane_acceleration_mps2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d hub_position_m = Eigen::Vector3d::Zero();  ///< with effects, as are all that follow
  Eigen::Vector3d hub_velocity_mps = Eigen::Vector3d::Zero();
  double arm_angle_rad = 0.0;               ///< over the horizontal
  double mass_kg = 0.0;                     ///< collector and pole
  double weight_n = 0.0, buoyancy_n = 0.0;  ///< of both, > 0
  // Of the last step:
  double tension_n = 0.0;                                 ///< at the load cell, > 0 when the rig pulls down
  Eigen::Vector3d ice_force_n = Eigen::Vector3d::Zero();  ///< of the ice on the rig
  Eigen::Vector3d load_n = Eigen::Vector3d::Zero();       ///< of effects on the rig: sum of RigLoads
  double added_mass_kg = 0.0;
};

struct Motion {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_mps = Eigen::Vector3d::Zero();
  Eigen::Vector3d acceleration_mps2 = Eigen::Vector3d::Zero();

  Motion& operator+=(const Motion& other) {
    position_m += other.position_m;
    velocity_mps += other.velocity_mps;
    acceleration_mps2 += other.acceleration_mps2;
    return *this;
  }

  void visitState(StateVisitor& visitor) {
    visitor("position_m", position_m);
    visitor("velocity_mps", velocity_mps);
    visitor("acceleration_mps2", acceleration_mps2);
  }
};

/// What effects add between crane and collector; all zero before each step's first effect.
struct Suspension {
  Motion point;    ///< of the suspension point, on top of the crane's own motion
  Motion stretch;  ///< of the hub against the suspension point
  /// Tension of a link that is not rigid, N; empty: it follows from loads and inertia.
  std::optional<double> tension_n;

  void visitState(StateVisitor& visitor) {
    point.visitState(visitor);
    stretch.visitState(visitor);
    visitor("tension_n", tension_n);
  }
};

struct RigLoads {
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();  ///< on collector and pole, frame map
  double added_mass_kg = 0.0;                         ///< water that has to be accelerated along

  void visitState(StateVisitor& visitor) {
    visitor("load_n", force_n);
    visitor("added_mass_kg", added_mass_kg);
  }
};

/// A physical mechanism that the baseline lacks, acting where it acts in nature. Override the hooks that it needs.
///
/// All hooks run in one thread. Effects act one after the other, in the order of the registry, on what the ones before
/// have left. Order of a step, after the ice has moved under the changes of the step before:
///   updateCraneVelocity -> crane and fold -> updateSuspension -> addRigLoads -> contact -> updateReading -> updateIce
/// The same input must give the same bits: no clocks, no unseeded randomness.
class Effect {
 public:
  virtual ~Effect() = default;

  /// Once, before the first step.
  virtual void createField(FieldAtCreation& /*field*/) {}

  /// The velocity that the crane is told to take, m/s; limits of speed, acceleration and travel come after. The rig is
  /// as the last step left it.
  virtual void updateCraneVelocity(const RigNow& /*rig*/, Eigen::Vector3d& /*wanted_mps*/) {}

  /// Adds its motion for the time at the end of the step. The crane has moved; the hub is still where the last step's
  /// motion puts it.
  virtual void updateSuspension(const RigNow& /*rig*/, Suspension& /*suspension*/) {}

  /// Adds forces on the rig, for its position and velocity of this step.
  virtual void addRigLoads(const RigNow& /*rig*/, RigLoads& /*loads*/) {}

  /// From the true force (of the crane on the rig, N; z is the tension) to what the load cell's electronics get. Called
  /// every step, and once before the first.
  virtual void updateReading(double /*time_s*/, double /*time_step_s*/, Eigen::Vector3d& /*force_n*/) {}

  /// Changes strength and mass for the next step. Called once before the first step too.
  virtual void updateIce(const IceNow& /*ice*/, IceChanges& /*changes*/) {}

  /// Visits everything that the effect remembers from step to step, always in the same order, for hash and checkpoint.
  virtual void visitState(StateVisitor& /*visitor*/) {}
};

/// From 0 at u <= 0 to 1 at u >= 1 with continuous first and second derivatives, 6 u^5 - 15 u^4 + 10 u^3, so that what
/// it fades in starts without a jump of velocity or acceleration.
struct Fade {
  double value, slope, curvature;  ///< and derivatives by u
};
Fade computeFade(double u);

/// Motion that comes up within kFadeInS: f(t) times the given path.
/// @param path     position, velocity and acceleration now
/// @param since_s  time since it began to come up
Motion fadeIn(const Motion& path, double since_s);
constexpr double kFadeInS = 2.0;

}  // namespace brash_ice_rig
