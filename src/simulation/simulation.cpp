#include "brash_ice_rig/simulation/simulation.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <omp.h>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/effects/effect.h"
#include "brash_ice_rig/ice/ice_field.h"
#include "brash_ice_rig/ice/ice_scaling.h"
#include "brash_ice_rig/material/cap_model.h"
#include "brash_ice_rig/material/scaled_strength.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/rig/collector.h"
#include "brash_ice_rig/rig/contact.h"
#include "brash_ice_rig/rig/crane.h"
#include "brash_ice_rig/rig/load_cell.h"
#include "brash_ice_rig/rig/procedure.h"
#include "brash_ice_rig/rig/rig_commands.h"
#include "brash_ice_rig/simulation/energy_audit.h"
#include "brash_ice_rig/simulation/numerical_guard.h"
#include "brash_ice_rig/simulation/pinned_thread.h"
#include "brash_ice_rig/simulation/plug.h"
#include "brash_ice_rig/sph/sph_body.h"
#include "brash_ice_rig/system/hash.h"
#include "brash_ice_rig/water/water.h"

namespace brash_ice_rig {
namespace {

/// Penetration at which contact is reported as saturated, over its offset.
constexpr double kSaturatedPenetration = 0.5;

/// Steps between two samples of the load cell: the step divides their period, so that each sample falls on a step.
std::uint64_t countStepsPerSample(const Scenario& s, const Material& material, double density_kgpm3) {
  const double wave_speed = computeWaveSpeed({0.0, material.bulkModulus(), material.shearModulus()}, density_kgpm3);
  const double largest_step = s.solver.cfl_ratio * s.solver.smoothing_ratio * s.field.spacing_m / wave_speed;
  return static_cast<std::uint64_t>(std::ceil(1.0 / s.load_cell.rate_hz / largest_step));
}

SphSettings makeSphSettings(const Scenario& s, double density_kgpm3, double time_step_s) {
  const double dx = s.field.spacing_m;
  SphSettings settings;
  settings.particle_volume_m3 = dx * dx * dx;
  settings.density_kgpm3 = density_kgpm3;
  settings.smoothing_length_m = s.solver.smoothing_ratio * dx;
  settings.variable_smoothing_length = s.solver.smoothing_length == SmoothingLength::kVariable;
  settings.viscosity_ratio = s.solver.viscosity_ratio;
  settings.viscosity_speed_mps = s.solver.viscosity_speed_mps;
  // An explicit step is stable up to 2, over the sum of the rates of both ends of a pair.
  settings.largest_viscous_rate_ps = 1.0 / time_step_s;
  settings.volume_ratio_limit = s.solver.volume_ratio_limit;
  settings.determinant_limit = s.solver.determinant_limit;
  settings.skin_m = s.solver.neighbour_skin_ratio * dx;
  settings.refresh_distance_m = s.solver.gradient_refresh_ratio * dx;
  settings.active_set.enabled = s.solver.active_set;
  settings.active_set.quiet_force_n =
      s.solver.quiet_force_ratio * density_kgpm3 * settings.particle_volume_m3 * kGravityMps2;
  // A particle that rises or sinks by this share of its height changes its buoyancy by about that share of its weight.
  settings.active_set.quiet_way_m = s.solver.quiet_force_ratio * dx;
  settings.active_set.quiet_time_s = s.solver.quiet_time_s;
  settings.active_set.spacing_m = dx;
  settings.active_set.time_step_s = time_step_s;
  settings.fastest_mps = static_cast<float>(NumericalGuard::computeFastest(s));
  return settings;
}

/// Inertia of a particle over that of the mean one, at least: lighter ones would need a smaller time step. The motion
/// is so slow that inertia hardly counts; weight has no such bound.
constexpr float kLeastInertia = 0.5f;

/// The pole stands in the ice from the start: blocks in its way have been pushed aside to its surface.
void makeRoomForPole(const Scenario& s, IceField& field) {
  if (s.procedure.start != StartPose::kUnfoldedUnderIce) return;
  const double clearance = s.collector.pole_radius_m + 0.5 * s.field.spacing_m;
  for (auto& p : field.position_m) {
    const double distance = p.head<2>().norm();
    if (distance >= clearance) continue;
    // One on the axis goes between the lattice's directions: along x it could meet its neighbour.
    const Eigen::Vector2d outward =
        distance > 0.0 ? Eigen::Vector2d(p.head<2>() / distance) : Eigen::Vector2d(2.0, 1.0).normalized();
    p.head<2>() = clearance * outward;
  }
}

/// The effects that a scenario has enabled, in the order in which they act.
std::vector<std::unique_ptr<Effect>> makeEffects(const Scenario& s) {
  std::vector<std::unique_ptr<Effect>> effects;
  for (const EffectValues& values : s.effects.all()) {
    if (values.enabled) effects.push_back(values.description().make(values, s));
  }
  return effects;
}

/// Whether an enabled effect has set this flag.
bool anyEffect(const Scenario& s, bool EffectDescription::*flag) {
  for (const EffectValues& values : s.effects.all()) {
    if (values.enabled && values.description().*flag) return true;
  }
  return false;
}

const Scenario& validated(const Scenario& scenario) {
  scenario.validate();
  return scenario;
}

class StateHasher : public StateVisitor {
 public:
  std::uint64_t value() const { return hash_.value(); }

 protected:
  std::size_t begin(const char*, std::size_t count, std::size_t, Length) override {
    const auto length = static_cast<std::uint64_t>(count);
    hash_.add(&length, sizeof length);
    return count;
  }
  void bytes(void* data, std::size_t count) override { hash_.add(data, count); }

 private:
  Hash hash_;
};

// Sections of a checkpoint.
constexpr char kWorldSection[] = "world";
constexpr char kBooksSection[] = "books";

}  // namespace

struct Simulation::Impl {
  explicit Impl(const Scenario& s);
  SphBody makeIce();

  void visitState(StateVisitor& visitor);
  void visitBooks(StateVisitor& visitor);
  std::uint64_t stateHash();
  void moveRig();
  void guard();
  void freeze(std::string reason);
  std::string describeBreakdown(const Breakdown& found) const;
  void takeCommands();
  std::optional<RigCommand> commandOfScript() const;
  void updateForces();
  void updateIce();
  RigNow rigNow() const;
  RigInstant rigInstant() const;
  const Material& law() const { return scaled_strength ? static_cast<const Material&>(*scaled_strength) : material; }
  Eigen::Vector4f waterForce(std::size_t i) const;
  /// Mass of ice over the mean particle's, and water in pores above the waterline, kg.
  double solidRatio(std::size_t i) const {
    return changes.solid_ratio.empty() ? 1.0 : static_cast<double>(changes.solid_ratio[i]);
  }
  double heldWater(std::size_t i) const {
    return changes.held_water_kg.empty() ? 0.0 : static_cast<double>(changes.held_water_kg[i]);
  }
  Eigen::Vector3d hubPosition() const;
  Eigen::Vector3d hubVelocity() const;
  double time() const { return (static_cast<double>(step_count) - static_cast<double>(steps_to_zero)) * time_step; }
  double hubHeight() const { return hubPosition().z(); }

  Scenario scenario;
  double sample_period;
  CapModel material;
  std::optional<ScaledStrength> scaled_strength;  ///< over the material, where an effect changes strength
  double density;
  std::uint64_t steps_per_sample;
  double time_step;
  std::uint64_t settle_steps, steps_to_zero;  ///< the latter with the rest after settling

  std::vector<std::unique_ptr<Effect>> effects;
  IceChanges changes;
  std::vector<float> pore_volume;
  double bottom_rise = 0.0;
  Suspension suspension;
  RigLoads loads;

  std::vector<Eigen::Vector3d> site;  ///< original positions
  SphBody ice;
  ParticleInWater water;
  Collector collector;
  Crane crane;
  RigContact contact;
  LoadCell load_cell;
  Procedure procedure;
  NumericalGuard numerical_guard;

  std::uint64_t step_count = 0;
  std::uint64_t active_particle_steps = 0;
  bool frozen = false;
  std::string breakdown;  ///< why
  StatusFlags flags;      ///< since the start of the present advance
  ContactSum contact_sum;
  Eigen::Vector3d support = Eigen::Vector3d::Zero();  ///< N, of the crane on the rig
  double fold_target;
  std::optional<EnergyAudit> audit;  ///< with output.energy only

  // Manual control.
  Eigen::Vector3d velocity_command = Eigen::Vector3d::Zero();
  std::uint64_t command_step = 0;

  // Single-slot mailbox, filled by any thread.
  std::mutex mailbox_mutex;
  std::optional<Eigen::Vector3d> mailbox_velocity;
  std::optional<double> mailbox_fold;
  bool mailbox_tare = false;
  std::optional<double> mailbox_noise, mailbox_resolution;  ///< of the load cell, N

  std::vector<RigCommand> script;    ///< of procedure.commands_file
  std::vector<RigCommand> commands;  ///< taken since the start of the present advance
};

Simulation::Impl::Impl(const Scenario& s)
    : scenario(validated(s)),
      sample_period(1.0 / s.load_cell.rate_hz),
      material(makeCapParameters(s.ice, s.solver.stiffness_scale, s.field.spacing_m)),
      scaled_strength([&] {
        std::optional<ScaledStrength> scaled;
        if (anyEffect(s, &EffectDescription::changes_strength)) scaled.emplace(material);
        return scaled;
      }()),
      density(computeBulkDensity(s.ice.parent_density_kgpm3, s.ice.void_fraction)),
      steps_per_sample(countStepsPerSample(s, material, density)),
      time_step(sample_period / static_cast<double>(steps_per_sample)),
      settle_steps(0),
      steps_to_zero(0),
      effects(makeEffects(s)),
      ice(makeIce()),
      water(s.water, s.ice, s.field.spacing_m),
      collector(s.collector, s.procedure.start == StartPose::kUnfoldedUnderIce),
      crane(s.crane, {0.0, 0.0, startHubHeight(s) + bottom_rise + s.collector.pole_length_m}),
      contact(s.contact, s.collector, material.bulkModulus(), s.field.spacing_m, ice.particleMass(), ice.size()),
      load_cell(s.load_cell),
      procedure(s.procedure, lowestHubHeight(s)),
      numerical_guard(s, static_cast<double>(ice.size()) * ice.particleMass()),
      fold_target(collector.foldRatio()) {
  // Settling and rest take whole samples, so that time 0 is one.
  const auto wholeSamples = [&](double duration_s) {
    return steps_per_sample * static_cast<std::uint64_t>(std::llround(duration_s / sample_period));
  };
  settle_steps = wholeSamples(s.procedure.settle_duration_s);
  steps_to_zero = settle_steps + wholeSamples(s.procedure.rest_duration_s);
  if (!s.procedure.commands_file.empty()) script = readCommands(s.procedure.commands_file);
  updateForces();
  load_cell.sample();
  updateIce();
  if (s.output.energy) audit.emplace(time_step, ice, law(), water, contact, rigInstant());
}

/// Field and body, as the enabled effects shape them.
SphBody Simulation::Impl::makeIce() {
  IceField field = makeIceField(scenario.field, iceDraft(scenario));
  const std::size_t count = field.position_m.size();
  const bool mass_varies = anyEffect(scenario, &EffectDescription::changes_mass);
  if (scaled_strength) changes.strength_ratio.assign(count, 1.0f);
  if (mass_varies) {
    changes.solid_ratio.assign(count, 1.0f);
    changes.held_water_kg.assign(count, 0.0f);
  }
  std::vector<float> volume_ratio = changes.solid_ratio;
  FieldAtCreation creation{scenario, field.position_m, volume_ratio, changes.solid_ratio};
  for (const auto& effect : effects) effect->createField(creation);
  bottom_rise = creation.bottom_rise_m;
  makeRoomForPole(scenario, field);
  site = field.position_m;

  const SphSettings settings = makeSphSettings(scenario, density, time_step);
  SphBody body(settings, law(), field.position_m, field.fixed);
  if (mass_varies) {
    const double solid = 1.0 - scenario.ice.void_fraction;
    for (std::size_t i = 0; i < count; ++i) {
      const auto volume = static_cast<double>(volume_ratio[i]), ice_share = static_cast<double>(changes.solid_ratio[i]);
      body.setVolume(i, volume * settings.particle_volume_m3);
      pore_volume.push_back(static_cast<float>((volume - ice_share * solid) * settings.particle_volume_m3));
    }
    body.inertiaRatio().assign(count, 1.0f);
  }
  return body;
}

/// Of the crane tip alone where no effect moves it: a sum with zero could still turn the sign of a zero.
Eigen::Vector3d Simulation::Impl::hubPosition() const {
  Eigen::Vector3d of_crane = crane.position() - Eigen::Vector3d(0.0, 0.0, scenario.collector.pole_length_m);
  if (effects.empty()) return of_crane;
  return of_crane + suspension.point.position_m + suspension.stretch.position_m;
}

Eigen::Vector3d Simulation::Impl::hubVelocity() const {
  if (effects.empty()) return crane.velocity();
  return crane.velocity() + suspension.point.velocity_mps + suspension.stretch.velocity_mps;
}

Eigen::Vector4f Simulation::Impl::waterForce(std::size_t i) const {
  Eigen::Vector4f force = water.force(static_cast<float>(ice.position()[i].z()), ice.velocity(i));
  if (changes.solid_ratio.empty()) return force;
  force *= changes.solid_ratio[i];
  force.z() -= static_cast<float>(kGravityMps2) * changes.held_water_kg[i];
  return force;
}

RigNow Simulation::Impl::rigNow() const {
  RigNow rig;
  rig.time_s = time();
  rig.time_step_s = time_step;
  rig.crane_velocity_mps = crane.velocity();
  rig.crane_acceleration_mps2 = crane.acceleration();
  rig.hub_position_m = hubPosition();
  rig.hub_velocity_mps = hubVelocity();
  rig.arm_angle_rad = collector.armAngle();
  rig.mass_kg = collector.mass();
  rig.weight_n = collector.weight();
  rig.buoyancy_n = collector.buoyancy(hubHeight(), scenario.water.density_kgpm3);
  rig.tension_n = support.z();
  rig.ice_force_n = contact_sum.total();
  rig.load_n = loads.force_n;
  rig.added_mass_kg = loads.added_mass_kg;
  return rig;
}

/// Lets the effects change the ice for the next step.
void Simulation::Impl::updateIce() {
  const bool strength = !changes.strength_ratio.empty(), mass = !changes.solid_ratio.empty();
  if (!strength && !mass) return;
  const auto names = law().stateNames();
  const auto plastic = std::find(names.begin(), names.end(), "plastic_strain") - names.begin();
  std::fill(changes.strength_ratio.begin(), changes.strength_ratio.end(), 1.0f);
  const IceNow now{
      time(),      time_step,          site,  ice.position(), ice.state()[static_cast<std::size_t>(plastic)],
      pore_volume, ice.particleMass(), water, hubPosition()};
  for (const auto& effect : effects) effect->updateIce(now, changes);
  // What fades, as held water does, never ends. Sleeping ice takes no notice of less than what may hold it in place.
  const auto unnoticed = static_cast<float>(scenario.solver.quiet_force_ratio);
  const ActiveSet& active = ice.activeSet();
  if (strength) {
    std::vector<float>& surplus = ice.state(0);
    for (std::size_t i = 0; i < surplus.size(); ++i) {
      const float before = surplus[i], now_surplus = changes.strength_ratio[i] - 1.0f;
      if (!active.isAwake(i) && now_surplus < before && before - now_surplus < unnoticed) continue;
      surplus[i] = now_surplus;
      if (now_surplus < before) ice.wake(i);  // what was strong enough to rest may yield now
    }
  }
  if (mass) {
    std::vector<float>& inertia = ice.inertiaRatio();
    const float water_share = 1.0f / static_cast<float>(ice.particleMass());
    for (std::size_t i = 0; i < inertia.size(); ++i) {
      const float now_inertia =
          std::max(changes.solid_ratio[i], kLeastInertia) + water_share * changes.held_water_kg[i];
      if (!active.isAwake(i) && std::abs(now_inertia - inertia[i]) < unnoticed) continue;
      inertia[i] = now_inertia;
      ice.wake(i);  // its weight has changed as well
    }
  }
}

void Simulation::Impl::takeCommands() {
  std::optional<Eigen::Vector3d> velocity;
  std::optional<double> fold;
  RigCommand taken;
  {
    const std::lock_guard<std::mutex> lock(mailbox_mutex);
    velocity.swap(mailbox_velocity);
    fold.swap(mailbox_fold);
    taken.tare = mailbox_tare;
    mailbox_tare = false;
    taken.load_cell_noise_n.swap(mailbox_noise);
    taken.load_cell_resolution_n.swap(mailbox_resolution);
  }
  taken.time_s = time();
  const bool manual = scenario.procedure.control == ControlMode::kManual && script.empty();
  if (velocity) {
    if (!velocity->allFinite()) {
      flags.set(StatusFlag::kCommandRejected);
      if (manual) taken.velocity_mps = Eigen::Vector3d::Zero();
    } else if (!manual) {
      flags.set(StatusFlag::kCommandIgnored);
    } else {
      taken.velocity_mps = velocity;
    }
  }
  if (fold) {
    if (!(*fold >= 0.0 && *fold <= 1.0)) {
      flags.set(StatusFlag::kCommandRejected);
    } else if (!manual) {
      flags.set(StatusFlag::kCommandIgnored);
    } else {
      taken.fold_target = fold;
    }
  }
  if (const std::optional<RigCommand> scripted = commandOfScript()) {
    taken.velocity_mps = scripted->velocity_mps;
    taken.fold_target = scripted->fold_target;
    taken.tare = taken.tare || scripted->tare;
    if (scripted->load_cell_noise_n) taken.load_cell_noise_n = scripted->load_cell_noise_n;
    if (scripted->load_cell_resolution_n) taken.load_cell_resolution_n = scripted->load_cell_resolution_n;
  }
  if (taken.tare) load_cell.tare();
  if (taken.velocity_mps) {
    velocity_command = *taken.velocity_mps;
    command_step = step_count;
  }
  if (taken.fold_target) fold_target = *taken.fold_target;
  if (taken.load_cell_noise_n || taken.load_cell_resolution_n) {
    const std::lock_guard<std::mutex> lock(mailbox_mutex);  // any thread may ask for the two
    if (taken.load_cell_noise_n) load_cell.setNoise(*taken.load_cell_noise_n);
    if (taken.load_cell_resolution_n) load_cell.setResolution(*taken.load_cell_resolution_n);
  }
  if (!taken.empty()) commands.push_back(taken);
}

/// Of procedure.commands_file: what is due at the present step. Times there are those of steps up to round-off, or
/// anybody's; several within one step count as one, the later over the earlier.
std::optional<RigCommand> Simulation::Impl::commandOfScript() const {
  const double half_step = 0.5 * time_step;
  auto next = std::lower_bound(script.begin(), script.end(), time() - half_step,
                               [](const RigCommand& command, double t) { return command.time_s < t; });
  std::optional<RigCommand> due;
  for (; next != script.end() && next->time_s < time() + half_step; ++next) {
    if (!due) due.emplace();
    if (next->velocity_mps) due->velocity_mps = next->velocity_mps;
    if (next->fold_target) due->fold_target = next->fold_target;
    due->tare = due->tare || next->tare;
    if (next->load_cell_noise_n) due->load_cell_noise_n = next->load_cell_noise_n;
    if (next->load_cell_resolution_n) due->load_cell_resolution_n = next->load_cell_resolution_n;
  }
  return due;
}

void Simulation::Impl::updateForces() {
  contact_sum = contact.update(time_step, ice, collector, hubPosition(), hubVelocity());
  if (contact_sum.deepest_m > kSaturatedPenetration * contact.offset()) flags.set(StatusFlag::kContactSaturated);
  support = collector.mass() * crane.acceleration() - contact_sum.total();
  support.z() += collector.weight() - collector.buoyancy(hubHeight(), scenario.water.density_kgpm3);
  if (!effects.empty()) {
    const Eigen::Vector3d moved = suspension.point.acceleration_mps2 + suspension.stretch.acceleration_mps2;
    support += collector.mass() * moved + loads.added_mass_kg * (crane.acceleration() + moved) - loads.force_n;
    if (suspension.tension_n) support.z() = *suspension.tension_n;
  }
  if (support.z() < 0.0) flags.set(StatusFlag::kHoistSlack);
  Eigen::Vector3d sensed = support;
  for (const auto& effect : effects) effect->updateReading(time(), time_step, sensed);
  load_cell.step(time_step, sensed);
}

RigInstant Simulation::Impl::rigInstant() const {
  RigInstant rig;
  rig.position_m = crane.position() + suspension.point.position_m;
  rig.velocity_mps = hubVelocity();
  rig.support_n = support;
  rig.arm_angle_rad = collector.armAngle();
  rig.mass_kg = collector.mass();
  rig.weight_n = collector.weight();
  rig.buoyancy_n = collector.buoyancy(hubHeight(), scenario.water.density_kgpm3);
  rig.contact = contact_sum;
  return rig;
}

void Simulation::Impl::guard() {
  if (ice.breakdown()) return freeze(describeBreakdown(*ice.breakdown()));
  const double kinetic_j = 0.5 * ice.particleMass() * ice.speedSquaredSum();
  if (kinetic_j <= numerical_guard.energyBound()) return;
  Breakdown fastest;
  for (std::size_t i = 0; i < ice.size(); ++i) {
    const double speed = static_cast<double>(ice.velocity(i).norm());
    if (speed > fastest.speed_mps) fastest = {i, speed, 0.0};
  }
  char text[160];
  std::snprintf(text, sizeof text,
                "the ice has a kinetic energy of %.4g J, but at most %.4g J were put in, fastest is ", kinetic_j,
                numerical_guard.energyBound());
  freeze(text + describeBreakdown(fastest));
}

void Simulation::Impl::freeze(std::string reason) {
  frozen = true;
  breakdown = std::move(reason);
  ice.clearNonFinite();
}

/// Names the particle and the force that drives it, which tells what to change.
std::string Simulation::Impl::describeBreakdown(const Breakdown& found) const {
  const std::size_t i = found.particle;
  const Eigen::Vector3d& at = ice.position()[i];
  const auto size = [](const Eigen::Vector4f& force) {
    const double norm = static_cast<double>(force.norm());
    return std::isnan(norm) ? std::numeric_limits<double>::infinity() : norm;
  };
  struct Cause {
    double force_n;
    const char* name;
    const char* remedy;
  };
  const Eigen::Vector4f viscous = ice.viscousForce(i);
  const Cause causes[] = {
      {size(contact.force(i)), "contact with net and pole",
       "lower contact.min_stiffness_npm, contact.stiffness_ratio or crane.max_speed_mps"},
      {size(viscous), "viscosity", "lower solver.viscosity_ratio, solver.viscosity_speed_mps or solver.cfl_ratio"},
      {size(waterForce(i)), "water", "lower water.drag_coefficient or solver.cfl_ratio"},
      {size(ice.internalForce(i) - viscous), "stress in the ice",
       "lower solver.cfl_ratio, solver.volume_ratio_limit or ice.cohesion_pa, or raise solver.determinant_limit"}};
  const Cause& cause = *std::max_element(std::begin(causes), std::end(causes),
                                         [](const Cause& a, const Cause& b) { return a.force_n < b.force_n; });
  char text[400];
  std::snprintf(text, sizeof text,
                "particle %zu at (%.3f, %.3f, %.3f) m, t = %.3f s: speed %.4g m/s (bound %.4g), volume %+.3g in the "
                "step, most of its force, %.4g N, is from %s: %s",
                i, at.x(), at.y(), at.z(), time(), found.speed_mps, NumericalGuard::computeFastest(scenario),
                found.volume_growth, cause.force_n, cause.name, cause.remedy);
  return text;
}

/// The second half of a step, after the ice has moved: the rig follows its orders, and the forces between the two are
/// brought up to date. They hold for the ice in the next step, and what a snapshot shows belongs to one instant.
void Simulation::Impl::moveRig() {
  guard();
  if (frozen) return;
  Eigen::Vector3d wanted = Eigen::Vector3d::Zero();
  // Whoever drives the crane sees how much rope is out, not what effects add below.
  const double height_of_crane = crane.position().z() - scenario.collector.pole_length_m;
  const Procedure::Order order = procedure.step(time(), time_step, crane, collector, height_of_crane);
  if (procedure.stage() == Stage::kManual) {
    const double age = static_cast<double>(step_count - command_step) * time_step;
    if (age <= scenario.crane.command_timeout_s) {
      wanted = velocity_command;
    } else if (!velocity_command.isZero()) {
      flags.set(StatusFlag::kCommandTimeout);
    }
  } else {
    wanted.z() = order.hoist_speed_mps;
  }
  // A fold command comes only once, so that one from the time of settling has to be kept until it counts.
  if (scenario.procedure.control == ControlMode::kScripted) fold_target = order.fold_target;
  const bool by_command = scenario.procedure.control == ControlMode::kManual && procedure.stage() != Stage::kSettle;
  const double fold_order = by_command ? fold_target : order.fold_target;
  for (const auto& effect : effects) effect->updateCraneVelocity(rigNow(), wanted);
  crane.step(time_step, wanted, flags);
  const double last_arm_angle = collector.armAngle();
  collector.step(time_step, fold_order, contact_sum.opening_moment_nm, flags);
  ++step_count;
  active_particle_steps += ice.activeSet().awakeCount();
  // What the rig may touch soon stays awake.
  const Eigen::Vector3d hub = hubPosition();
  ice.keepAwake(hub.head<2>(), collector.armLength() + 2.0 * scenario.field.spacing_m);
  if (!effects.empty()) {
    Suspension moved;
    for (const auto& effect : effects) effect->updateSuspension(rigNow(), moved);
    suspension = moved;
    loads = RigLoads();
    for (const auto& effect : effects) effect->addRigLoads(rigNow(), loads);
  }
  const ContactSum last_contact_sum = contact_sum;
  const Eigen::Vector3d last_support = support;
  updateForces();
  if (!support.allFinite() || !contact_sum.total().allFinite()) {
    contact_sum = last_contact_sum;
    support = last_support;
    return freeze(
        "the force of the crane on the rig is not finite: lower contact.min_stiffness_npm, contact.stiffness_ratio or "
        "the parameters of the effects that act on rig and load cell");
  }
  numerical_guard.addWork(support.dot(hubVelocity()) * time_step);
  numerical_guard.addWork(contact_sum.opening_moment_nm * (collector.armAngle() - last_arm_angle));
  updateIce();
  if (audit) audit->observeRig(rigInstant());
  if (step_count % steps_per_sample == 0) load_cell.sample();
}

Simulation::Simulation(const Scenario& scenario) : impl_(std::make_unique<Impl>(scenario)) {}
Simulation::~Simulation() = default;
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;

const Scenario& Simulation::scenario() const {
  return impl_->scenario;
}
double Simulation::timeStep() const {
  return impl_->time_step;
}
double Simulation::samplePeriod() const {
  return impl_->sample_period;
}
std::size_t Simulation::particleCount() const {
  return impl_->ice.size();
}
std::uint64_t Simulation::stepCount() const {
  return impl_->step_count;
}
std::uint64_t Simulation::activeParticleSteps() const {
  return impl_->active_particle_steps;
}
bool Simulation::frozen() const {
  return impl_->frozen;
}
const std::string& Simulation::breakdown() const {
  return impl_->breakdown;
}
bool Simulation::finished() const {
  return impl_->frozen || impl_->procedure.stage() == Stage::kDone;
}

void Simulation::setCraneVelocity(const Eigen::Vector3d& velocity_mps) {
  const std::lock_guard<std::mutex> lock(impl_->mailbox_mutex);
  impl_->mailbox_velocity = velocity_mps;
}

void Simulation::setFoldTarget(double ratio) {
  const std::lock_guard<std::mutex> lock(impl_->mailbox_mutex);
  impl_->mailbox_fold = ratio;
}

void Simulation::tare() {
  const std::lock_guard<std::mutex> lock(impl_->mailbox_mutex);
  impl_->mailbox_tare = true;
}

void Simulation::setLoadCellNoise(double noise_n) {
  const std::lock_guard<std::mutex> lock(impl_->mailbox_mutex);
  impl_->mailbox_noise = noise_n;
}

void Simulation::setLoadCellResolution(double resolution_n) {
  const std::lock_guard<std::mutex> lock(impl_->mailbox_mutex);
  impl_->mailbox_resolution = resolution_n;
}

double Simulation::loadCellNoise() const {
  const std::lock_guard<std::mutex> lock(impl_->mailbox_mutex);
  return impl_->mailbox_noise.value_or(impl_->load_cell.noise());
}

double Simulation::loadCellResolution() const {
  const std::lock_guard<std::mutex> lock(impl_->mailbox_mutex);
  return impl_->mailbox_resolution.value_or(impl_->load_cell.resolution());
}

StepReport Simulation::advance(double duration_s) {
  assert(duration_s > 0.0);
  Impl& world = *impl_;
  const std::uint64_t first = world.step_count;
  const auto steps = std::max<std::int64_t>(std::llround(duration_s / world.time_step), 1);
  world.flags = StatusFlags();
  world.commands.clear();

  const auto external = [&world](std::size_t i) -> Eigen::Vector4f {
    return world.waterForce(i) + world.contact.force(i);
  };
  const std::vector<int> cores = world.scenario.solver.pin_threads ? allowedCores() : std::vector<int>();
  // One team for all steps: opening one costs more than a barrier.
#pragma omp parallel num_threads(world.scenario.solver.threads)
  {
    const PinnedThread pinned(cores, static_cast<std::size_t>(omp_get_thread_num()));
    for (std::int64_t step = 0; step < steps; ++step) {
      if (world.frozen) break;
      if (step == 0) {
#pragma omp single
        world.takeCommands();
      }
      const double damping =
          world.step_count < world.settle_steps ? world.scenario.procedure.settle_damping_per_s : 0.0;
      world.ice.updateGradients();
      if (world.audit) world.audit->beginStep();
      world.ice.updateStress(world.time_step);
      if (!world.audit) {
        // The rest of the step is one thread's, without a barrier in between.
        world.ice.updateMotion(world.time_step, damping, external, [&world, last = step + 1 == steps] {
          world.moveRig();
          if (!last) world.takeCommands();
        });
        continue;
      }
      world.ice.updateMotion(world.time_step, damping, external);
      world.audit->endStep(damping);
#pragma omp single
      {
        world.moveRig();
        if (step + 1 < steps) world.takeCommands();
      }
    }
  }
  if (world.frozen) world.flags.set(StatusFlag::kNonFinite);

  StepReport report;
  report.steps = world.step_count - first;
  report.flags = world.flags;
  report.commands = std::move(world.commands);
  return report;
}

Snapshot Simulation::snapshot() const {
  const Impl& world = *impl_;
  Snapshot snapshot;
  snapshot.time_s = world.time();
  snapshot.stage = world.procedure.stage();
  snapshot.load_cell_force_n = world.load_cell.reading();
  snapshot.force_n = snapshot.load_cell_force_n.z();
  snapshot.ice_force_n = world.contact_sum.total();
  snapshot.flags = world.flags;

  snapshot.rig.crane_position_m = world.crane.position() + world.suspension.point.position_m;
  snapshot.rig.crane_velocity_mps = world.crane.velocity() + world.suspension.point.velocity_mps;
  snapshot.rig.commanded_velocity_mps = world.crane.commanded();
  snapshot.rig.hoist_position_m = world.hubHeight();
  snapshot.rig.crane_hub_height_m = world.crane.position().z() - world.scenario.collector.pole_length_m;
  snapshot.rig.fold_ratio = world.collector.foldRatio();
  snapshot.rig.fold_target = world.fold_target;
  snapshot.rig.arm_angle_rad = world.collector.armAngle();
  snapshot.rig.locked = world.collector.locked();

  ForceBalance& c = snapshot.components;
  c.weight_n = world.collector.weight();
  c.buoyancy_n = world.collector.buoyancy(world.hubHeight(), world.scenario.water.density_kgpm3);
  c.ice_normal_n = 0.0 - world.contact_sum.normal_n.z();  // not -0 where there is no ice
  c.ice_friction_n = 0.0 - world.contact_sum.friction_n.z();
  c.inertia_n = world.collector.mass() * world.crane.acceleration().z();
  if (!world.effects.empty()) {
    c.inertia_n = world.support.z() - (c.weight_n - c.buoyancy_n + c.ice_normal_n + c.ice_friction_n);
  }
  snapshot.support_n = world.support;
  snapshot.tension_n = world.support.z();

  double speed_squared_sum = 0.0;
  for (std::size_t i = 0; i < world.ice.size(); ++i) {
    const Eigen::Vector4f velocity = world.ice.velocity(i);
    const double solid = world.solidRatio(i);
    speed_squared_sum += solid * static_cast<double>(velocity.squaredNorm());
    const Eigen::Vector3d& position = world.ice.position()[i];
    if (!isRaised(world.site[i], position, world.scenario.field.spacing_m, world.hubHeight())) continue;
    const float submerged = world.water.submerged(static_cast<float>(position.z()));
    c.plug_gravity_n += solid * static_cast<double>(world.water.weight()) + kGravityMps2 * world.heldWater(i);
    c.plug_buoyancy_n += solid * static_cast<double>(world.water.buoyancy(submerged));
    c.plug_drag_n -= solid * static_cast<double>(world.water.drag(velocity, submerged).z());
  }
  c.plug_friction_n = c.ice_normal_n + c.ice_friction_n - (c.plug_gravity_n - c.plug_buoyancy_n + c.plug_drag_n);
  snapshot.kinetic_energy_j = 0.5 * world.ice.particleMass() * speed_squared_sum;
  if (world.audit) snapshot.energy = world.audit->balance();
  return snapshot;
}

ParticleCloud Simulation::particles() const {
  const Impl& world = *impl_;
  const std::size_t count = world.ice.size();
  ParticleCloud cloud;
  cloud.x_m.reserve(count);
  cloud.y_m.reserve(count);
  cloud.z_m.reserve(count);
  cloud.speed_mps.reserve(count);
  cloud.pressure_pa.reserve(count);
  cloud.submerged.reserve(count);
  const auto& stress = world.ice.stress();
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3f position = world.ice.position()[i].cast<float>();
    cloud.x_m.push_back(position.x());
    cloud.y_m.push_back(position.y());
    cloud.z_m.push_back(position.z());
    cloud.speed_mps.push_back(world.ice.velocity(i).norm());
    cloud.pressure_pa.push_back(-(stress[0][i] + stress[1][i] + stress[2][i]) / 3.0f);
    cloud.submerged.push_back(world.water.submerged(position.z()));
  }
  const auto names = world.law().stateNames();
  const auto state = [&](const char* name) {
    const auto found = std::find(names.begin(), names.end(), name);
    return found == names.end() ? std::vector<float>(count, 0.0f)
                                : world.ice.state()[static_cast<std::size_t>(found - names.begin())];
  };
  cloud.plastic_strain = state("plastic_strain");
  cloud.damage = state("damage");
  return cloud;
}

PlugSummary Simulation::plug() const {
  const Impl& world = *impl_;
  const double spacing = world.scenario.field.spacing_m;
  PlugSummary plug =
      computePlug(world.site, world.ice.position(), spacing, world.ice.particleMass(), world.hubHeight());
  if (world.changes.solid_ratio.empty()) return plug;
  plug.lifted_mass_kg = 0.0;
  for (std::size_t i = 0; i < world.ice.size(); ++i) {
    if (!isRaised(world.site[i], world.ice.position()[i], spacing, world.hubHeight())) continue;
    plug.lifted_mass_kg += world.ice.particleMass() * world.solidRatio(i);
  }
  return plug;
}

PlugOutline Simulation::plugOutline() const {
  return computePlugOutline(impl_->site, impl_->ice.position(), impl_->scenario.field.spacing_m, impl_->hubHeight());
}

/// All that decides the future.
void Simulation::Impl::visitState(StateVisitor& visitor) {
  visitor("step_count", step_count);
  ice.visitState(visitor);
  changes.visitState(visitor);
  for (const auto& effect : effects) effect->visitState(visitor);
  suspension.visitState(visitor);
  loads.visitState(visitor);
  collector.visitState(visitor);
  crane.visitState(visitor);
  contact.visitState(visitor);
  contact_sum.visitState(visitor);
  load_cell.visitState(visitor);
  procedure.visitState(visitor);
  visitor("support_n", support);
  visitor("fold_target", fold_target);
  visitor("velocity_command_mps", velocity_command);
  visitor("command_step", command_step);
  const std::lock_guard<std::mutex> lock(mailbox_mutex);
  visitor("mailbox_velocity_mps", mailbox_velocity);
  visitor("mailbox_fold", mailbox_fold);
  visitor("mailbox_tare", mailbox_tare);
  visitor("mailbox_noise_n", mailbox_noise);
  visitor("mailbox_resolution_n", mailbox_resolution);
}

/// What is only counted and shown. It depends on how a run was cut into advances, or whether the audit watches.
void Simulation::Impl::visitBooks(StateVisitor& visitor) {
  visitor("active_particle_steps", active_particle_steps);
  numerical_guard.visitState(visitor);
  flags.visitState(visitor);
  if (audit) audit->visitState(visitor);
  const std::uint64_t present_hash = stateHash();
  std::uint64_t hash = present_hash;
  visitor("state_hash", hash);
  if (hash != present_hash) visitor.refuse("the world came out otherwise than it was saved");
}

std::uint64_t Simulation::Impl::stateHash() {
  StateHasher hasher;
  visitState(hasher);
  return hasher.value();
}

std::uint64_t Simulation::stateHash() const {
  return impl_->stateHash();
}

void Simulation::save(CheckpointWriter& file) const {
  if (impl_->frozen) throw OutputError(file.path(), "not written: the world is frozen by a non-finite state");
  file.add(kWorldSection, [this](StateVisitor& visitor) { impl_->visitState(visitor); });
  file.add(kBooksSection, [this](StateVisitor& visitor) { impl_->visitBooks(visitor); });
}

Simulation Simulation::load(CheckpointReader& file, std::optional<int> threads) {
  // Its particles must be there before the scenario's word is taken for their number.
  const double smallest =
      brash_ice_rig::particleCount(file.scenario().field) * static_cast<double>(sizeof(Eigen::Vector3d));
  if (static_cast<double>(file.size(kWorldSection)) < smallest) {
    file.refuse("holds fewer particles than its scenario has");
  }
  Scenario scenario = file.scenario();
  if (threads) scenario.solver.threads = *threads;
  try {
    scenario.validate();
  } catch (const ConfigError& error) {
    file.refuse(std::string("its scenario: ") + error.what());
  }
  Simulation simulation(scenario);
  file.read(kWorldSection, [&](StateVisitor& visitor) { simulation.impl_->visitState(visitor); });
  file.read(kBooksSection, [&](StateVisitor& visitor) { simulation.impl_->visitBooks(visitor); });
  return simulation;
}

void Simulation::save(const std::string& path) const {
  CheckpointWriter file(path, scenario());
  save(file);
  file.commit();
}

Simulation Simulation::load(const std::string& path) {
  CheckpointReader file(path);
  return load(file);
}

}  // namespace brash_ice_rig
