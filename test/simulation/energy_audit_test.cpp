#include "brash_ice_rig/simulation/energy_audit.h"

#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "../sph/elastic_material.h"
#include "brash_ice_rig/material/cap_model.h"
#include "brash_ice_rig/simulation/simulation.h"

namespace brash_ice_rig {
namespace {

constexpr double kGravity = 9.81, kSpacing = 0.3, kMass = 9.72;  // of B-1's particle: 900 kg/m³ * 0.4 * (0.3 m)³

struct WorldSettings {
  double time_step_s = 1.0e-3;
  double drag_coefficient = 0.0;
  double viscosity_ratio = 0.0;
  double damping_per_s = 0.0;
  double ice_density_kgpm3 = 900.0;    ///< for weight only
  const Material* material = nullptr;  ///< none: elastic, K = 0.75 MPa, G = 0.35 MPa
};

/// Ice, water and a flat collector in the hands of a test, stepped as the simulation does it.
struct World {
  explicit World(const std::vector<Eigen::Vector3d>& points, const WorldSettings& world_settings = WorldSettings())
      : dt(world_settings.time_step_s),
        damping(world_settings.damping_per_s),
        material(world_settings.material != nullptr ? *world_settings.material : elastic) {
    WaterConfig water_config;
    water_config.drag_coefficient = world_settings.drag_coefficient;
    IceConfig ice_config;
    ice_config.parent_density_kgpm3 = world_settings.ice_density_kgpm3;
    water = std::make_unique<ParticleInWater>(water_config, ice_config, kSpacing);
    SphSettings settings;
    settings.particle_volume_m3 = kSpacing * kSpacing * kSpacing;
    settings.density_kgpm3 = kMass / settings.particle_volume_m3;
    settings.smoothing_length_m = 1.2 * kSpacing;
    settings.viscosity_ratio = world_settings.viscosity_ratio;
    settings.determinant_limit = 1.0e-3;
    ice = std::make_unique<SphBody>(settings, material, points, std::vector<bool>(points.size(), false));
    collector_config.rim_height_m = 0.0;
    collector = std::make_unique<Collector>(collector_config, true);
    contact_config.friction_decay_spm = 0.0;
    contact = std::make_unique<RigContact>(contact_config, collector_config, 7.5e5, kSpacing, kMass, points.size());
  }

  /// Counts from here on.
  void startAudit() {
    rig.contact = contact->update(dt, *ice, *collector, hub, hub_velocity);
    audit = std::make_unique<EnergyAudit>(dt, *ice, material, *water, *contact, rig);
  }

  void step(bool moves = true) {
    const auto external = [this](std::size_t i) -> Eigen::Vector4f {
      return water->force(static_cast<float>(ice->position()[i].z()), ice->velocity(i)) + contact->force(i);
    };
    ice->updateGradients();
    audit->beginStep();
    ice->updateStress(dt);
    if (moves) ice->updateMotion(dt, damping, external);
    audit->endStep(damping);
    hub += dt * hub_velocity;
    rig.position_m = hub;
    rig.velocity_mps = hub_velocity;
    rig.contact = contact->update(dt, *ice, *collector, hub, hub_velocity);
    rig.support_n = -rig.contact.total();  // of a rig without mass
    audit->observeRig(rig);
  }
  EnergyBalance run(double duration_s) {
    if (!audit) startAudit();
    for (int k = 0; k < std::lround(duration_s / dt); ++k) step();
    return audit->balance();
  }
  double height() const { return ice->position()[0].z(); }

  double dt, damping;
  ElasticMaterial elastic{7.5e5, 3.5e5};
  const Material& material;
  Eigen::Vector3d hub{0.0, 0.0, -100.0};
  Eigen::Vector3d hub_velocity = Eigen::Vector3d::Zero();
  CollectorConfig collector_config;
  ContactConfig contact_config;
  RigInstant rig;
  std::unique_ptr<ParticleInWater> water;
  std::unique_ptr<SphBody> ice;
  std::unique_ptr<Collector> collector;
  std::unique_ptr<RigContact> contact;
  std::unique_ptr<EnergyAudit> audit;
};

/// n x n x n particles around a centre.
std::vector<Eigen::Vector3d> block(int n, const Eigen::Vector3d& centre) {
  std::vector<Eigen::Vector3d> points;
  for (int x = 0; x < n; ++x)
    for (int y = 0; y < n; ++y)
      for (int z = 0; z < n; ++z) {
        points.push_back(centre + kSpacing * (Eigen::Vector3d(x, y, z) - Eigen::Vector3d::Constant(0.5 * (n - 1))));
      }
  return points;
}

WorldSettings fineSteps() {
  WorldSettings world_settings;
  world_settings.time_step_s = 1.0e-4;
  return world_settings;
}

TEST(Energy, FreeFallTurnsWeightIntoHalfMTimesGTSquared) {
  World world({{0.0, 0.0, 50.0}});
  const EnergyBalance energy = world.run(1.0);
  const double expected = 0.5 * kMass * kGravity * kGravity;
  // A thousand additions to a speed of single precision, each rounded by up to 4.8e-7 m/s.
  const double rounding = kMass * kGravity * 1000.0 * 4.8e-7;
  // The position moves with the speed at the end of each step: half a step's way too far.
  const double half_step = expected * world.dt;
  EXPECT_NEAR(energy.kinetic_j, expected, rounding);
  EXPECT_NEAR(energy.weight_j, -expected - half_step, rounding);
  EXPECT_NEAR(energy.imbalance(), half_step, rounding);
  EXPECT_EQ(energy.buoyancy_j, 0.0);
  EXPECT_EQ(energy.drag_j, 0.0);
}

TEST(Energy, FloatingBlockSwingsBetweenHalfKASquaredOfHeightAndOfSpeed) {
  // Between the waterlines buoyancy is a spring of rho g (1 - V_f) A, here 353.16 N/m; it floats with 0.9 submerged.
  const double stiffness = 1000.0 * kGravity * 0.4 * kSpacing * kSpacing, amplitude = 0.02;
  World world({{0.0, 0.0, -0.4 * kSpacing + amplitude}}, fineSteps());
  const double quarter_period = 0.5 * M_PI * std::sqrt(kMass / stiffness);
  const EnergyBalance swing = world.run(quarter_period);
  const double expected = 0.5 * stiffness * amplitude * amplitude;
  EXPECT_NEAR(swing.kinetic_j, expected, 1.0e-3 * expected);
  EXPECT_NEAR(swing.weight_j + swing.buoyancy_j, -expected, 1.0e-3 * expected);
  const EnergyBalance later = world.run(40.0 * quarter_period);
  EXPECT_NEAR(later.imbalance(), 0.0, 1.0e-3 * expected);
}

TEST(Energy, DragAtConstantSpeedTakesForceTimesWay) {
  // Rising at the speed at which 1/2 C_d rho (1 - V_f) A v² is buoyancy less weight.
  const double lift = (1000.0 - 900.0) * 0.4 * std::pow(kSpacing, 3) * kGravity;
  const double speed = std::sqrt(2.0 * lift / (1.05 * 1000.0 * 0.4 * kSpacing * kSpacing));
  WorldSettings world_settings;
  world_settings.drag_coefficient = 1.05;
  World world({{0.0, 0.0, -50.0}}, world_settings);
  world.ice->setVelocity(0, {0.0, 0.0, speed});
  const EnergyBalance energy = world.run(10.0);
  EXPECT_NEAR(energy.drag_j, lift * speed * 10.0, 1.0e-4 * energy.drag_j);
  EXPECT_NEAR(energy.weight_j + energy.buoyancy_j, -energy.drag_j, 1.0e-4 * energy.drag_j);
}

TEST(Energy, SlidingTakesFrictionTimesNormalForceTimesWay) {
  // On the net, in air: the net runs away below the block as a conveyor belt does.
  const double normal = kMass * kGravity, friction = 0.57;
  World world({{0.5, 0.2, 5.0}}, fineSteps());
  const double sag = normal / world.contact->normalStiffness();
  world.hub = {0.0, 0.0, 5.0 - 0.5 * kSpacing + sag};
  world.hub_velocity = {1.0, 0.0, 0.0};
  world.rig.position_m = world.hub;
  const double start = world.ice->position()[0].x();
  const double duration = 0.15;  // it slips for 1 m/s over mu g, 0.179 s
  const EnergyBalance energy = world.run(duration);
  const double way = world.ice->position()[0].x() - start;
  const double stretch = friction * normal / (0.5 * world.contact->normalStiffness());  // before it slips
  EXPECT_NEAR(energy.friction_j, friction * normal * (1.0 * duration - way - stretch), 2.0e-3 * energy.friction_j);
  EXPECT_NEAR(energy.work_on_ice_j, friction * normal * duration, 2.0e-2 * energy.work_on_ice_j);
  EXPECT_NEAR(energy.work_received_j, energy.kinetic_j, 2.0e-3 * energy.kinetic_j);
  EXPECT_NEAR(energy.contact_spring_j, 0.5 * friction * normal * stretch, 2.0e-2 * energy.contact_spring_j);
  EXPECT_NEAR(energy.imbalance(), 0.0, 1.0e-3 * energy.friction_j);
}

TEST(Energy, BounceOnTheNetLosesInTheDamperWhatHeightAndSpeedLose) {
  World world({{0.5, 0.2, 5.0}}, fineSteps());
  world.hub = {0.0, 0.0, 5.0 - 0.5 * kSpacing - 0.02};  // falls 2 cm, bounces, comes to rest
  world.rig.position_m = world.hub;
  const EnergyBalance energy = world.run(3.0);
  const double sag = kMass * kGravity / world.contact->normalStiffness();
  const double fallen = kMass * kGravity * (0.02 + sag);
  EXPECT_NEAR(world.height(), 5.0 - 0.02 - sag, 1.0e-6);
  EXPECT_NEAR(energy.contact_spring_j, 0.5 * kMass * kGravity * sag, 1.0e-3 * fallen);
  EXPECT_NEAR(energy.contact_damper_j, fallen - 0.5 * kMass * kGravity * sag, 1.0e-2 * fallen);
}

TEST(Energy, UniformStrainStoresLamesEnergyAndNothingIsPlastic) {
  World world(block(4, {0.0, 0.0, 50.0}));
  world.startAudit();
  Eigen::Matrix3d rate;
  rate << -0.02, 0.01, 0.0, 0.01, 0.005, 0.015, 0.0, 0.015, -0.01;
  for (std::size_t i = 0; i < world.ice->size(); ++i) world.ice->setVelocity(i, rate * world.ice->position()[i]);
  for (int k = 0; k < 100; ++k) world.step(false);
  const EnergyBalance energy = world.audit->balance();
  const Eigen::Matrix3d strain = 0.1 * rate;
  const double bulk = 7.5e5, shear = 3.5e5, trace = strain.trace();
  const double density = 0.5 * (bulk - 2.0 / 3.0 * shear) * trace * trace + shear * strain.squaredNorm();
  const double volume = 64.0 * std::pow(kSpacing, 3);
  EXPECT_NEAR(energy.elastic_j, density * volume, 3.0e-3 * density * volume);  // the block shrinks by 0.25 %
  EXPECT_NEAR(energy.plastic_j, 0.0, 3.0e-3 * density * volume);
}

TEST(Energy, ReleasedElasticBlockTurnsItsStressIntoSpeed) {
  WorldSettings world_settings;
  world_settings.time_step_s = 2.0e-5;
  world_settings.ice_density_kgpm3 = 1000.0;  // as heavy as the water
  World world(block(5, {0.0, 0.0, -50.0}), world_settings);
  for (std::size_t i = 0; i < world.ice->size(); ++i) {
    world.ice->setStress(i, {-2000.0f, -2000.0f, -2000.0f, 0.0f, 0.0f, 0.0f});
  }
  const double stored = 125.0 * std::pow(kSpacing, 3) * 2000.0 * 2000.0 / (2.0 * 7.5e5);  // p² / 2K
  // Energy is counted per present volume, which changes by p/K while the stress goes.
  const double volume_change = stored * 2000.0 / 7.5e5;
  double given = 0.0;
  for (int k = 0; k < 100; ++k) {
    const EnergyBalance energy = world.run(1.0e-3);
    given = std::max(given, -energy.elastic_j);
    EXPECT_NEAR(energy.kinetic_j, -energy.elastic_j, 2.0 * volume_change);
    EXPECT_NEAR(energy.plastic_j, 0.0, volume_change);
    EXPECT_NEAR(energy.imbalance(), 0.0, 1.0e-4 * stored);
  }
  EXPECT_GT(given, 0.7 * stored);
  EXPECT_LT(given, stored);
}

TEST(Energy, PlasticCompressionTakesTheAreaUnderTheHardeningCurve) {
  // Eq. 12 with set 1 of Table 6 gives X = 3322.57, 4815.2, 6528.1 and 8537.6 Pa at e = 0.01 to 0.04, X0 = 2000 Pa. The
  // mean stress is X/3 and the volume V0 exp(-e): the plastic work is the integral of V0 exp(-e) X/3 over e (Simpson).
  IceConfig config;
  config.shear_constant_pa = 200.0;
  config.shear_slope = 0.396;
  CapParameters parameters = makeCapParameters(config, 1.0, 0.3);
  const CapModel material(parameters);
  const double x[] = {2000.0, 3322.57, 4815.2, 6528.1, 8537.6}, weight[] = {1.0, 4.0, 2.0, 4.0, 1.0};
  double density = 0.0;
  for (int k = 0; k < 5; ++k) density += 0.01 / 3.0 * weight[k] * std::exp(-0.01 * k) * x[k] / 3.0;

  WorldSettings world_settings;
  world_settings.material = &material;
  World world(block(4, {0.0, 0.0, 50.0}), world_settings);
  world.startAudit();
  for (std::size_t i = 0; i < world.ice->size(); ++i) {
    world.ice->setVelocity(i, -0.04 / 3.0 * (world.ice->position()[i] - Eigen::Vector3d(0.0, 0.0, 50.0)));
  }
  for (int k = 0; k < 1000; ++k) world.step(false);
  const double expected = 64.0 * std::pow(kSpacing, 3) * density;
  EXPECT_NEAR(world.audit->balance().plastic_j, expected, 1.0e-3 * expected);
}

TEST(Energy, ViscosityTakesTheEnergyOfRelativeMotion) {
  // Ice without stiffness, as heavy as the water: two halves that move against each other end at rest.
  const ElasticMaterial soft(1.0e-6, 1.0e-6);
  WorldSettings world_settings;
  world_settings.viscosity_ratio = 1.0;
  world_settings.ice_density_kgpm3 = 1000.0;
  world_settings.material = &soft;
  World world(block(4, {0.0, 0.0, -50.0}), world_settings);
  for (std::size_t i = 0; i < 64; ++i) world.ice->setVelocity(i, {i < 32 ? -1.0e-3 : 1.0e-3, 0.0, 0.0});
  const double kinetic = 0.5 * 64.0 * kMass * 1.0e-6;
  const EnergyBalance energy = world.run(2.0);
  EXPECT_GT(-energy.kinetic_j, 0.5 * kinetic);
  EXPECT_NEAR(energy.viscous_j, -energy.kinetic_j, 1.0e-4 * kinetic);
}

TEST(Energy, MassDampingTakesAllOfHalfMVSquared) {
  WorldSettings world_settings;
  world_settings.damping_per_s = 5.0;
  world_settings.ice_density_kgpm3 = 1000.0;
  World world({{0.0, 0.0, -50.0}}, world_settings);
  world.ice->setVelocity(0, {0.3, 0.0, 0.4});
  EXPECT_NEAR(world.run(4.0).settle_damping_j, 0.5 * kMass * 0.25, 1.0e-5);
}

TEST(Energy, CraneAndFoldWorkAreForceTimesWayAndMomentTimesTurn) {
  World world({{0.0, 0.0, 50.0}});
  world.rig.support_n = {30.0, 0.0, 100.0};
  world.rig.weight_n = 70.0;
  world.rig.buoyancy_n = 20.0;
  world.rig.mass_kg = 8.0;
  world.startAudit();
  world.rig.contact.opening_moment_nm = 50.0;
  world.audit->observeRig(world.rig);
  world.rig.position_m += Eigen::Vector3d(1.0, 0.0, 2.0);
  world.rig.velocity_mps = {0.0, 0.0, 0.5};
  world.rig.arm_angle_rad = -0.4;
  world.audit->observeRig(world.rig);
  const EnergyBalance energy = world.audit->balance();
  EXPECT_NEAR(energy.crane_work_j, 30.0 + 200.0, 1.0e-12);
  EXPECT_NEAR(energy.fold_work_j, -20.0, 1.0e-12);
  EXPECT_NEAR(energy.work_on_ice_j, -20.0, 1.0e-12);
  EXPECT_NEAR(energy.rig_potential_j, 100.0, 1.0e-12);
  EXPECT_NEAR(energy.rig_kinetic_j, 1.0, 1.0e-12);
  EXPECT_NEAR(energy.rigImbalance(), 230.0 - 100.0 - 1.0, 1.0e-12);
}

/// 1,600 particles; the collector lifts for 3 s.
Scenario pullUp() {
  Scenario s;
  s.field.length_x_m = s.field.length_y_m = 6.0;
  s.collector.radius_m = 0.7;
  s.collector.rim_height_m = 0.2;
  s.procedure.settle_duration_s = 1.0;
  s.procedure.lift_duration_s = 3.0;
  s.solver.threads = 1;
  s.output.energy = true;
  return s;
}

EnergyBalance balanceAfter(const Scenario& scenario, double duration_s) {
  Simulation simulation(scenario);
  simulation.advance(duration_s);
  return simulation.snapshot().energy.value();
}

TEST(EnergyOfAPullUp, IsFoundAgainWithinATenthOfAPercent) {
  const EnergyBalance energy = balanceAfter(pullUp(), 4.0);
  EXPECT_GT(energy.crane_work_j, 300.0);
  EXPECT_LT(std::abs(energy.imbalanceRatio()), 1.0e-3);
  EXPECT_LT(std::abs(energy.discretisation_j), 1.0e-3 * energy.crane_work_j);
  EXPECT_GT(energy.plastic_j, 0.0);
  EXPECT_GT(energy.viscous_j, 0.0);
  EXPECT_GT(energy.friction_j, 0.0);
  EXPECT_GT(energy.settle_damping_j, 0.0);
}

TEST(EnergyOfAPullUp, RestAfterSettlingIsWithoutDamping) {
  Scenario s = pullUp();
  s.procedure.settle_duration_s = 0.2;  // too short, so that the field still bobs
  s.procedure.rest_duration_s = 1.0;
  Simulation simulation(s);
  simulation.advance(0.2);
  const double damped_j = simulation.snapshot().energy->settle_damping_j;
  EXPECT_GT(damped_j, 0.0);
  simulation.advance(1.0);
  EXPECT_NEAR(simulation.snapshot().time_s, 0.0, 1e-12);
  EXPECT_EQ(simulation.snapshot().stage, Stage::kSettle);
  EXPECT_GT(simulation.snapshot().energy->kinetic_j, 0.0);
  EXPECT_EQ(simulation.snapshot().energy->settle_damping_j, damped_j);
}

TEST(EnergyOfAPullUp, ImbalanceIsOfFirstOrderInTheTimeStep) {
  Scenario coarse = pullUp(), fine = pullUp();
  // Ice that falls asleep loses a little, too, whatever the step.
  coarse.solver.active_set = fine.solver.active_set = false;
  coarse.solver.cfl_ratio = 0.9;
  fine.solver.cfl_ratio = 0.45;
  ASSERT_NEAR(Simulation(coarse).timeStep(), 5.0e-3, 1.0e-9);
  ASSERT_NEAR(Simulation(fine).timeStep(), 2.5e-3, 1.0e-9);
  const EnergyBalance a = balanceAfter(coarse, 4.0), b = balanceAfter(fine, 4.0);
  EXPECT_NEAR(b.rigImbalance() / a.rigImbalance(), 0.5, 0.1);
  EXPECT_NEAR(b.iceImbalance() / a.iceImbalance(), 0.5, 0.1);
}

TEST(EnergyOfAPullUp, ArmsThatGiveWayTakeWorkFromTheIce) {
  Scenario s = pullUp();
  s.collector.fault = FoldFault::kNoLock;
  s.collector.unlocked_holding_moment_nm = 20.0;
  Simulation simulation(s);
  simulation.advance(4.0);
  const Snapshot now = simulation.snapshot();
  const double turn = unfoldedArmAngle(s.collector) - now.rig.arm_angle_rad;
  ASSERT_GT(turn, 0.1);
  // A step turns the arms only if the ice's moment before it exceeds what holds them; after it may be anything from 0.
  EXPECT_LT(now.energy->fold_work_j, -0.5 * 20.0 * turn);
  EXPECT_LT(std::abs(now.energy->imbalanceRatio()), 1.0e-3);
}

TEST(EnergyOfAPullUp, WatchingChangesNothingAndThreadsDoNotEither) {
  Scenario off = pullUp(), on = pullUp(), two = pullUp();
  off.output.energy = false;
  two.solver.threads = 2;
  Simulation a(off), b(on), c(two);
  for (Simulation* simulation : {&a, &b, &c}) simulation->advance(2.5);
  EXPECT_EQ(a.stateHash(), b.stateHash());
  EXPECT_EQ(a.stateHash(), c.stateHash());
  EXPECT_FALSE(a.snapshot().energy.has_value());
  const EnergyBalance one_thread = b.snapshot().energy.value(), two_threads = c.snapshot().energy.value();
  for (const EnergyTerm& term : kEnergyTerms) EXPECT_EQ(one_thread.*term.value, two_threads.*term.value) << term.name;
}

TEST(EnergyOfAPullUp, SumsDoNotDependOnTheLengthOfAnAdvance) {
  Simulation whole(pullUp()), pieces(pullUp());
  whole.advance(1.5);
  for (int k = 0; k < 150; ++k) pieces.advance(0.01);
  const EnergyBalance a = whole.snapshot().energy.value(), b = pieces.snapshot().energy.value();
  for (const EnergyTerm& term : kEnergyTerms) EXPECT_EQ(a.*term.value, b.*term.value) << term.name;
}

TEST(EnergyBalance, RatioIsOverTheSizeOfTheCranesWorkAndNeedsSome) {
  EnergyBalance energy;
  EXPECT_TRUE(std::isnan(energy.imbalanceRatio()));
  energy.crane_work_j = -200.0;
  energy.plastic_j = 50.0;
  EXPECT_DOUBLE_EQ(energy.imbalance(), -250.0);
  EXPECT_DOUBLE_EQ(energy.imbalanceRatio(), -1.25);  // over its size, so that the sign is that of the imbalance
}

}  // namespace
}  // namespace brash_ice_rig
