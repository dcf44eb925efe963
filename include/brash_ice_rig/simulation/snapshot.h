#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/simulation/energy_balance.h"
#include "brash_ice_rig/simulation/status.h"

namespace brash_ice_rig {

enum class Stage { kSettle, kLower, kUnfold, kLift, kHold, kDone, kManual };

/// Lower-case name, e.g. "lift".
const char* stageName(Stage stage);

/// Vertical forces in N. Those on the load cell add up to its tension (positive: the rig pulls down on the crane):
/// tension = weight - buoyancy + ice_normal + ice_friction + inertia.
/// Those on the plug follow Fig. 4 of the paper: plug_friction is what the plug's own weight, buoyancy and drag leave
/// of the ice force, i.e. what the surrounding ice adds by friction and cohesion (and, while the plug accelerates,
/// inertia).
struct ForceBalance {
  double weight_n = 0.0;         ///< collector and pole, > 0
  double buoyancy_n = 0.0;       ///< of collector and pole, > 0
  double ice_normal_n = 0.0;     ///< ice on net and pole, normal part, > 0 down
  double ice_friction_n = 0.0;   ///< ice on net and pole, tangential part, > 0 down
  double inertia_n = 0.0;        ///< mass of collector and pole times upward acceleration; with effects, what the
                                 ///< other terms leave, so that drag and added mass of the collector are in it
  double plug_gravity_n = 0.0;   ///< weight of the raised ice and of water that it holds, > 0
  double plug_buoyancy_n = 0.0;  ///< buoyancy of the raised ice, > 0
  double plug_drag_n = 0.0;      ///< water drag on the raised ice, > 0 when it opposes lifting
  double plug_friction_n = 0.0;  ///< see above, > 0 when it adds to the load
};

/// Crane tip, pole and collector.
struct RigState {
  Eigen::Vector3d crane_position_m = Eigen::Vector3d::Zero();  ///< suspension point, frame map
  Eigen::Vector3d crane_velocity_mps = Eigen::Vector3d::Zero();
  Eigen::Vector3d commanded_velocity_mps = Eigen::Vector3d::Zero();  ///< after limits
  double hoist_position_m = 0.0;    ///< height of the hub over the still waterline, up positive
  double crane_hub_height_m = 0.0;  ///< the same without what effects add below the crane: the rope that is out
  double fold_ratio = 1.0;          ///< 0 folded, 1 unfolded, > 1 drooping because it did not lock
  double fold_target = 1.0;
  double arm_angle_rad = 0.0;  ///< arm over the horizontal, < 0 drooping
  bool locked = true;
};

/// The ice over the collector's hub that has been raised by more than one spacing, and the bulge of the surface above
/// it.
struct PlugSummary {
  double lifted_mass_kg = 0.0;
  std::size_t raised_particles = 0;
  double radius_at_waterline_m = 0.0;  ///< of a disc with the raised ice's section at z = 0; 0: none there
  double radius_at_top_m = 0.0;        ///< the same for the layer below the highest raised particle
  std::size_t hole_sites = 0;          ///< original sites of the raised particles
  double hole_refill_ratio = 0.0;      ///< share of hole sites into which neighbours have moved, 0..1
  double hole_cover_ratio = 0.0;       ///< the same seen from above: share of the hole's columns, those raised from the
                                       ///< bottom layer up, with ice of neighbours at any depth
  double bulge_height_m = 0.0;         ///< largest rise of a particle of the top layer over its original site, >= 0
  double bulge_radius_m = 0.0;         ///< farthest original distance from the axis of a particle of the top layer
                                       ///< that has risen by more than a tenth of the spacing; 0: none has
};

/// The raised ice for display. Horizontal convex polygons, counter-clockwise from above, with corners at most one
/// particle spacing apart; frame map, m; empty without ice. Waterline and hole lie on the highest ice that is left
/// around them, at least at z = 0, for lower down it would hide them.
struct PlugOutline {
  std::vector<Eigen::Vector3d> waterline;  ///< section at z = 0
  std::vector<Eigen::Vector3d> top;   ///< section of the highest layer, at the height of the highest raised particle
  std::vector<Eigen::Vector3d> hole;  ///< where ice was raised from the bottom layer up
};

/// State at one instant. Cheap to copy; particles are fetched apart.
struct Snapshot {
  double time_s = 0.0;  ///< 0 is the end of settling and rest; negative before
  Stage stage = Stage::kSettle;
  double force_n = 0.0;                                         ///< load-cell reading with sensor errors and tare
  double tension_n = 0.0;                                       ///< the truth behind it
  Eigen::Vector3d support_n = Eigen::Vector3d::Zero();          ///< true force of the crane on the rig; z = tension_n
  Eigen::Vector3d load_cell_force_n = Eigen::Vector3d::Zero();  ///< its reading along x, y, and z = force_n
  Eigen::Vector3d ice_force_n = Eigen::Vector3d::Zero();        ///< of the ice on net and pole, frame map
  ForceBalance components;
  RigState rig;
  double kinetic_energy_j = 0.0;
  std::optional<EnergyBalance> energy;  ///< since the start of the run; only with output.energy
  StatusFlags flags;
};

/// Particles for display and files; all arrays have one entry per particle.
struct ParticleCloud {
  std::vector<float> x_m, y_m, z_m;
  std::vector<float> speed_mps;
  std::vector<float> pressure_pa;     ///< > 0 in compression
  std::vector<float> plastic_strain;  ///< accumulated deviatoric plastic strain
  std::vector<float> damage;          ///< 0 intact .. 1 gone
  std::vector<float> submerged;       ///< share under water, 0..1
  std::size_t size() const { return x_m.size(); }
};

}  // namespace brash_ice_rig
