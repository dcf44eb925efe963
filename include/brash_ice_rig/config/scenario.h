#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "brash_ice_rig/config/range.h"
#include "brash_ice_rig/effects/effect_registry.h"

namespace brash_ice_rig {

// Every section below lists its keys once, in visit(). Reader, range check, writer of the effective
// scenario, `brash_ice check` and the tests that feed bad values all walk that list:
//   v(name, member, Range, text)            number (double, int, std::uint64_t, std::optional<double>)
//   v(name, member, text)                   bool, std::string
//   v(name, member, {"word", ...}, text)    enum, in the order of its enumerators
//   v.section(name, member)                 section; may hold sections itself
// Defaults are the paper's simulation B-1 where the paper states a value.

/// Box of brash ice, cut into a lattice of particles (Table 3 of the paper).
struct FieldConfig {
  double length_x_m = 15.0;
  double length_y_m = 15.0;
  double thickness_m = 1.2;
  double spacing_m = 0.3;
  double jitter_ratio = 0.0;
  std::uint64_t seed = 1;

  template <class Visitor>
  void visit(Visitor& v) {
    v("length_x_m", length_x_m, Range{0.0, 1000.0, true}, "length of the field along x");
    v("length_y_m", length_y_m, Range{0.0, 1000.0, true}, "length of the field along y");
    v("thickness_m", thickness_m, Range{0.0, 20.0, true}, "undisturbed thickness of the brash ice");
    v("spacing_m", spacing_m, Range{0.0, 5.0, true}, "particle spacing, about the size of an ice block");
    v("jitter_ratio", jitter_ratio, Range{0.0, 0.3},
      "largest random offset of a particle from its lattice site, in spacings");
    v("seed", seed, Range{0.0, 9007199254740992.0}, "seed of the jitter");
  }
};

enum class FlowRule { kAssociated, kNonAssociated };

/// Brash ice as a continuum: parent ice (Table 4), void fraction, cap model (Tables 5 and 6) and damage (Table 7).
struct IceConfig {
  std::string model = "recommended";
  double void_fraction = 0.6;
  double cohesion_pa = 200.0;
  double friction_angle_deg = 50.0;
  double parent_density_kgpm3 = 900.0;
  double parent_elastic_modulus_pa = 4.0e9;
  double poisson_ratio = 0.3;
  std::optional<double> shear_constant_pa;
  std::optional<double> shear_slope;
  double cap_aspect_ratio = 8.957;
  double cap_initial_intercept_pa = 2000.0;
  double cap_max_compaction = 0.093;
  double cap_hardening_linear_per_pa = 86.0e-6;
  double cap_hardening_quadratic_per_pa2 = 0.03e-12;
  FlowRule flow_rule = FlowRule::kAssociated;
  bool three_invariant = false;
  bool damage = true;
  bool gap_memory = true;
  double parent_fracture_energy_compression_jpm2 = 20.0;
  double parent_fracture_toughness_pa_sqrt_m = 1.0e5;
  double damage_ductile_shape = 1.0;
  double damage_brittle_shape = 1.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v("model", model, "name of this set of choices, for reports; config/ice/ has two");
    v("void_fraction", void_fraction, Range{0.0, 1.0, true, true}, "share of the volume that is not ice, V_f");
    v("cohesion_pa", cohesion_pa, Range{0.0, 1.0e6, true}, "Mohr-Coulomb cohesion c");
    v("friction_angle_deg", friction_angle_deg, Range{0.0, 75.0, true}, "Mohr-Coulomb angle of internal friction");
    v("parent_density_kgpm3", parent_density_kgpm3, Range{500.0, 1000.0}, "density of solid ice");
    v("parent_elastic_modulus_pa", parent_elastic_modulus_pa, Range{1.0e6, 2.0e10},
      "elastic modulus of the parent level ice");
    v("poisson_ratio", poisson_ratio, Range{0.0, 0.45}, "Poisson's ratio");
    v("shear_constant_pa", shear_constant_pa, Range{0.0, 1.0e6, true},
      "alpha of the shear surface; default: eq. 10 from cohesion and friction angle");
    v("shear_slope", shear_slope, Range{0.0, 0.57, true},
      "theta of the shear surface; default: eq. 10 from the friction angle");
    v("cap_aspect_ratio", cap_aspect_ratio, Range{0.5, 100.0}, "R, ratio of the axes of the cap");
    v("cap_initial_intercept_pa", cap_initial_intercept_pa, Range{1.0, 1.0e8},
      "X0, pressure invariant J1 at which virgin ice compacts");
    v("cap_max_compaction", cap_max_compaction, Range{0.0, 0.9, true}, "W, largest plastic volume strain");
    v("cap_hardening_linear_per_pa", cap_hardening_linear_per_pa, Range{0.0, 1.0, true}, "D1 of eq. 12");
    v("cap_hardening_quadratic_per_pa2", cap_hardening_quadratic_per_pa2, Range{0.0, 1.0}, "D2 of eq. 12");
    v("flow_rule", flow_rule, {"associated", "non_associated"},
      "direction of plastic flow: along the yield surface's normal, or without volume change on the shear part");
    v("three_invariant", three_invariant, "lower strength in torsion and extension (eq. 11)");
    v("damage", damage, "ice that breaks loses stiffness and cohesion (Table 7)");
    v("gap_memory", gap_memory, "an opened gap must close before pressure returns");
    v("parent_fracture_energy_compression_jpm2", parent_fracture_energy_compression_jpm2, Range{1.0e-3, 1.0e6},
      "fracture energy of the parent ice in compression (eq. 13)");
    v("parent_fracture_toughness_pa_sqrt_m", parent_fracture_toughness_pa_sqrt_m, Range{1.0e2, 1.0e8},
      "fracture toughness of the parent ice (eq. 14)");
    v("damage_ductile_shape", damage_ductile_shape, Range{0.01, 100.0}, "B of Table 7, softening in compression");
    v("damage_brittle_shape", damage_brittle_shape, Range{0.01, 100.0}, "D of Table 7, softening in tension");
  }
};

/// Sea water below z = 0.
struct WaterConfig {
  double density_kgpm3 = 1000.0;
  double drag_coefficient = 1.05;

  template <class Visitor>
  void visit(Visitor& v) {
    v("density_kgpm3", density_kgpm3, Range{500.0, 1200.0}, "density of the water");
    v("drag_coefficient", drag_coefficient, Range{0.0, 10.0}, "C_d of eq. 3; 1.05 is a cube");
  }
};

enum class FoldFault { kNone, kJam, kNoLock };

/// The umbrella: hub, eight arms, and the net between them as an octagonal cone.
struct CollectorConfig {
  double radius_m = 1.3;
  double rim_height_m = 0.3;
  double mass_kg = 200.0;
  double displaced_volume_m3 = 0.02;
  double folded_arm_angle_deg = 80.0;
  double unfold_duration_s = 10.0;
  FoldFault fault = FoldFault::kNone;
  double jam_ratio = 0.5;
  double unlocked_holding_moment_nm = 300.0;
  double pole_length_m = 6.0;
  double pole_radius_m = 0.05;
  double pole_mass_kg = 40.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v("radius_m", radius_m, Range{0.1, 20.0}, "from the pole's axis to an arm's tip when unfolded");
    v("rim_height_m", rim_height_m, Range{0.0, 5.0}, "height of the arm tips over the hub when unfolded");
    v("mass_kg", mass_kg, Range{0.0, 1.0e5}, "mass of hub, arms and net");
    v("displaced_volume_m3", displaced_volume_m3, Range{0.0, 100.0}, "water displaced by hub, arms and net");
    v("folded_arm_angle_deg", folded_arm_angle_deg, Range{45.0, 88.0}, "arm over the horizontal when folded");
    v("unfold_duration_s", unfold_duration_s, Range{0.5, 600.0}, "time from folded to unfolded");
    v("fault", fault, {"none", "jam", "no_lock"}, "trouble of the folding mechanism");
    v("jam_ratio", jam_ratio, Range{0.0, 1.0, false, true}, "fold ratio at which the mechanism sticks (fault: jam)");
    v("unlocked_holding_moment_nm", unlocked_holding_moment_nm, Range{0.0, 1.0e6},
      "moment of the ice on all arms that an unlocked mechanism still holds (fault: no_lock)");
    v("pole_length_m", pole_length_m, Range{1.0, 100.0}, "from hub to load cell");
    v("pole_radius_m", pole_radius_m, Range{0.005, 1.0}, "radius of the pole");
    v("pole_mass_kg", pole_mass_kg, Range{0.0, 1.0e5}, "mass of the pole");
  }
};

/// Ice on collector and pole: penalty contact with friction (eq. 4).
struct ContactConfig {
  double stiffness_ratio = 0.1;
  double min_stiffness_npm = 5.0e4;
  double damping_ratio = 0.2;
  double tangential_stiffness_ratio = 0.5;
  double friction_static = 0.57;
  double friction_dynamic = 0.06;
  double friction_decay_spm = 0.02;

  template <class Visitor>
  void visit(Visitor& v) {
    v("stiffness_ratio", stiffness_ratio, Range{0.0, 10.0}, "normal stiffness over bulk modulus times spacing");
    v("min_stiffness_npm", min_stiffness_npm, Range{1.0, 1.0e12}, "lower bound of the normal stiffness");
    v("damping_ratio", damping_ratio, Range{0.0, 1.0}, "normal damping over critical damping");
    v("tangential_stiffness_ratio", tangential_stiffness_ratio, Range{0.01, 1.0},
      "stiffness of the friction spring over the normal stiffness");
    v("friction_static", friction_static, Range{0.0, 5.0}, "mu_S of eq. 4");
    v("friction_dynamic", friction_dynamic, Range{0.0, 5.0}, "mu_D of eq. 4");
    v("friction_decay_spm", friction_decay_spm, Range{0.0, 1.0e5},
      "D_c of eq. 4 in s/m; the paper prints 0.02 without a unit");
  }
};

/// Crane tip: where the load cell hangs.
struct CraneConfig {
  double max_speed_mps = 0.5;
  double max_acceleration_mps2 = 0.5;
  double max_height_m = 12.0;
  double min_height_m = -2.0;
  double max_reach_m = 5.0;
  double command_timeout_s = 0.25;

  template <class Visitor>
  void visit(Visitor& v) {
    v("max_speed_mps", max_speed_mps, Range{0.0, 10.0, true}, "largest speed along each axis");
    v("max_acceleration_mps2", max_acceleration_mps2, Range{0.0, 100.0, true}, "largest acceleration along each axis");
    v("max_height_m", max_height_m, Range{-100.0, 200.0}, "highest position of the crane tip over the waterline");
    v("min_height_m", min_height_m, Range{-100.0, 200.0}, "lowest position of the crane tip over the waterline");
    v("max_reach_m", max_reach_m, Range{0.0, 100.0}, "largest distance from the start along x and along y");
    v("command_timeout_s", command_timeout_s, Range{0.02, 60.0},
      "simulated time after which an unrepeated velocity command is stale and the crane stops");
  }
};

/// Sensor between crane and pole.
struct LoadCellConfig {
  double rate_hz = 100.0;
  double noise_n = 0.0;
  double bias_n = 0.0;
  double lag_s = 0.0;
  double resolution_n = 0.0;
  std::uint64_t seed = 1;

  template <class Visitor>
  void visit(Visitor& v) {
    v("rate_hz", rate_hz, Range{1.0, 1000.0}, "samples per simulated second");
    v("noise_n", noise_n, Range{0.0, 1.0e5}, "standard deviation of white noise");
    v("bias_n", bias_n, Range{-1.0e6, 1.0e6}, "constant offset of the reading");
    v("lag_s", lag_s, Range{0.0, 60.0}, "time constant of the first-order response");
    v("resolution_n", resolution_n, Range{0.0, 1.0e5}, "step between two readings; 0: continuous");
    v("seed", seed, Range{0.0, 9007199254740992.0}, "seed of the noise");
  }
};

enum class ControlMode { kScripted, kManual };
enum class StartPose { kUnfoldedUnderIce, kFoldedAboveIce };

/// The test as a script. Stages: settle, lower, unfold, lift, hold, done; in manual control settle, manual.
struct ProcedureConfig {
  ControlMode control = ControlMode::kScripted;
  StartPose start = StartPose::kUnfoldedUnderIce;
  double start_gap_m = 0.0;
  double settle_duration_s = 3.0;
  double settle_damping_per_s = 5.0;
  double rest_duration_s = 0.0;
  double lower_speed_mps = 0.2;
  double lower_clearance_m = 0.2;
  double lift_speed_mps = 0.052;
  double lift_duration_s = 40.0;
  double hold_duration_s = 0.0;
  std::string motion_file;
  std::string commands_file;

  /// Simulated time before time 0, s.
  double timeBeforeZero() const { return settle_duration_s + rest_duration_s; }

  template <class Visitor>
  void visit(Visitor& v) {
    v("control", control, {"scripted", "manual"}, "who drives crane and fold: this script, or commands from outside");
    v("start", start, {"unfolded_under_ice", "folded_above_ice"},
      "unfolded_under_ice skips lower and unfold, as the paper's simulations do");
    v("start_gap_m", start_gap_m, Range{0.0, 50.0},
      "unfolded_under_ice: water between rim and ice bottom; folded_above_ice: air between hub and ice top");
    v("settle_duration_s", settle_duration_s, Range{0.0, 600.0}, "rest in which the ice finds its balance");
    v("settle_damping_per_s", settle_damping_per_s, Range{0.0, 100.0}, "mass damping during that rest only");
    v("rest_duration_s", rest_duration_s, Range{0.0, 600.0},
      "rest after settling, before time 0; what moves a rig at rest, vessel_heave, begins with it");
    v("lower_speed_mps", lower_speed_mps, Range{0.0, 10.0, true}, "speed of lowering");
    v("lower_clearance_m", lower_clearance_m, Range{0.0, 20.0},
      "water between the folded arm tips and the ice bottom at the end of lowering");
    v("lift_speed_mps", lift_speed_mps, Range{0.0, 10.0, true}, "speed of lifting");
    v("lift_duration_s", lift_duration_s, Range{0.0, 3600.0, true}, "time of lifting");
    v("hold_duration_s", hold_duration_s, Range{0.0, 3600.0}, "time of hanging still after the lift");
    v("motion_file", motion_file,
      "CSV with time_s and hoist_position_m: the lift follows this way instead of lift_speed_mps and lift_duration_s");
    v("commands_file", commands_file,
      "CSV with the commands of a test: they count as if they came from outside at these times");
  }
};

enum class SmoothingLength { kConstant, kVariable };

/// Discretisation. None of these keys is a property of the ice.
struct SolverConfig {
  double stiffness_scale = 1.0e-3;
  double cfl_ratio = 0.81;
  double smoothing_ratio = 1.2;
  SmoothingLength smoothing_length = SmoothingLength::kConstant;
  double viscosity_ratio = 0.1;
  double viscosity_speed_mps = 58.0;
  double volume_ratio_limit = 1.5;
  double determinant_limit = 0.1;
  double neighbour_skin_ratio = 0.4;
  double gradient_refresh_ratio = 0.01;
  bool active_set = true;
  double quiet_force_ratio = 0.02;
  double quiet_time_s = 0.1;
  int threads = 2;
  bool pin_threads = false;

  template <class Visitor>
  void visit(Visitor& v) {
    v("stiffness_scale", stiffness_scale, Range{1.0e-5, 1.0}, "factor on the elastic modulus; sets the time step");
    v("cfl_ratio", cfl_ratio, Range{0.001, 0.9}, "time step times wave speed over smoothing length, at most");
    v("smoothing_ratio", smoothing_ratio, Range{1.0, 2.0}, "smoothing length over spacing");
    v("smoothing_length", smoothing_length, {"constant", "variable"},
      "the same for all particles and times, or with the cube root of each particle's volume");
    v("viscosity_ratio", viscosity_ratio, Range{0.0, 1.0}, "alpha of the Monaghan viscosity");
    v("viscosity_speed_mps", viscosity_speed_mps, Range{0.0, 5000.0}, "wave speed in the viscosity, fixed on purpose");
    v("volume_ratio_limit", volume_ratio_limit, Range{1.0, 10.0, true},
      "a particle's volume stays within 1/this and this");
    v("determinant_limit", determinant_limit, Range{0.0, 1.0},
      "gradient correction is left out where the determinant of its matrix is smaller");
    v("neighbour_skin_ratio", neighbour_skin_ratio, Range{0.01, 1.0}, "margin of the neighbour search, in spacings");
    v("gradient_refresh_ratio", gradient_refresh_ratio, Range{0.0, 0.1},
      "kernel gradients are recomputed once a particle has moved by this, in spacings");
    v("active_set", active_set, "ice at rest is not computed until something pushes it");
    v("quiet_force_ratio", quiet_force_ratio, Range{0.0, 1.0, true},
      "force that may hold a sleeping particle in place, over its weight (active_set)");
    v("quiet_time_s", quiet_time_s, Range{0.0, 600.0, true}, "rest before ice falls asleep (active_set)");
    v("threads", threads, Range{1.0, 256.0}, "OpenMP threads; results do not depend on it");
    v("pin_threads", pin_threads, "each thread stays on a core of its own while the simulation advances");
  }
};

/// What `brash_ice run` and the node write.
struct OutputConfig {
  double vtk_interval_s = 0.0;
  bool energy = false;

  template <class Visitor>
  void visit(Visitor& v) {
    v("vtk_interval_s", vtk_interval_s, Range{0.0, 3600.0}, "simulated time between VTK snapshots; 0: none");
    v("energy", energy, "follow where the work of the crane goes: energy.csv");
  }
};

/// One pull-up test, complete. Units are in the names; SI.
struct Scenario {
  std::string title = "Pull-up test";
  FieldConfig field;
  IceConfig ice;
  WaterConfig water;
  CollectorConfig collector;
  ContactConfig contact;
  CraneConfig crane;
  LoadCellConfig load_cell;
  ProcedureConfig procedure;
  SolverConfig solver;
  OutputConfig output;
  EffectsConfig effects;  ///< what the baseline lacks, all off

  template <class Visitor>
  void visit(Visitor& v) {
    v("title", title, "one line for plots and reports");
    v.section("field", field);
    v.section("ice", ice);
    v.section("water", water);
    v.section("collector", collector);
    v.section("contact", contact);
    v.section("crane", crane);
    v.section("load_cell", load_cell);
    v.section("procedure", procedure);
    v.section("solver", solver);
    v.section("output", output);
    v.section("effects", effects);
  }

  /// Checks each key's range and the rules that tie keys together (a collector larger than the field, a particle
  /// count beyond memory, a crane that cannot reach the start...).
  /// @throws ConfigError naming key, value and rule
  void validate() const;
};

/// Standard gravity as the paper uses it, m/s².
constexpr double kGravityMps2 = 9.81;

/// Working memory that one particle takes, bytes, rounded up: state and copies, and the list of its neighbours with
/// cached gradients, which grows with the cube of their distance.
double bytesPerParticle(const SolverConfig& solver);

/// Lattice sites along one length of the field: the length over the spacing, rounded; ≥ 0. A double, because a typing
/// error in the spacing must not overflow before validate() has refused it.
double sitesAlong(double length_m, double spacing_m);

/// Particles of the field: the product of sitesAlong() for its three lengths.
double particleCount(const FieldConfig& field);

/// Thickness that the lattice has, m: whole layers of one spacing, nearest to thickness_m.
double latticeThickness(const FieldConfig& field);

// Heights are in m over the still waterline (z = 0), up positive. The hub is the collector's lowest point unless the
// arms droop.

/// Depth of the undisturbed ice bottom below the waterline, m, > 0: lattice thickness times ice over water density. The
/// void fraction drops out, because eqs. 1 and 2 scale weight and buoyancy alike.
double iceDraft(const Scenario& scenario);

/// From the hub to an arm's tip, m.
double armLength(const CollectorConfig& collector);

/// Arm over the horizontal when unfolded and locked, rad.
double unfoldedArmAngle(const CollectorConfig& collector);

/// Hub when the procedure starts: under the ice with the rim start_gap_m below it, or start_gap_m above the ice.
double startHubHeight(const Scenario& scenario);

/// Hub when the lift begins. After lowering, the folded arm tips are lower_clearance_m below the ice bottom.
double lowestHubHeight(const Scenario& scenario);

/// Hub at the end of the lift.
double liftEndHubHeight(const Scenario& scenario);

}  // namespace brash_ice_rig
