#include "brash_ice_rig/simulation/energy_audit.h"

#include <cassert>

namespace brash_ice_rig {
namespace {

Eigen::Vector3d toDouble(const Eigen::Vector4f& v) {
  return v.head<3>().cast<double>();
}

Eigen::Matrix3d stressTensor(const SphBody& ice, std::size_t i) {
  const auto& s = ice.stress();
  const auto value = [&](std::size_t c) { return static_cast<double>(s[c][i]); };
  Eigen::Matrix3d tensor;
  tensor << value(0), value(3), value(5),  //
      value(3), value(1), value(4),        //
      value(5), value(4), value(2);
  return tensor;
}

}  // namespace

EnergyAudit::EnergyAudit(double time_step_s, const SphBody& ice, const Material& material, const ParticleInWater& water,
                         const RigContact& contact, const RigInstant& rig)
    : time_step_(time_step_s),
      ice_(ice),
      material_(material),
      water_(water),
      contact_(contact),
      work_(ice.size()),
      start_(ice.size()),
      first_(stored()),
      first_rig_(rig),
      rig_(rig) {
  assert(time_step_s > 0.0);
}

void EnergyAudit::beginStep() {
#pragma omp for schedule(static)
  for (std::size_t i = 0; i < ice_.size(); ++i) {
    Start& start = start_[i];
    start.velocity = ice_.velocity(i);
    start.height = static_cast<float>(ice_.position()[i].z());
    // The stress works on the strain in a frame that turns with the particle: as the material sees both.
    const Eigen::Matrix3d increment = time_step_ * ice_.velocityGradient(i).cast<double>();
    start.strain = 0.5 * (increment + increment.transpose());
    const Eigen::Matrix3d spin = 0.5 * (increment - increment.transpose());
    const Eigen::Matrix3d stress = stressTensor(ice_, i);
    const Eigen::Matrix3d turned = stress + spin * stress - stress * spin;
    work_[i].stress += 0.5 * static_cast<double>(ice_.volume()[i]) * turned.cwiseProduct(start.strain).sum();
  }
}

void EnergyAudit::endStep(double damping_per_s) {
#pragma omp for schedule(static)
  for (std::size_t i = 0; i < ice_.size(); ++i) {
    const Start& start = start_[i];
    Work& work = work_[i];
    work.stress += 0.5 * static_cast<double>(ice_.volume()[i]) * stressTensor(ice_, i).cwiseProduct(start.strain).sum();
    if (ice_.isFixed(i)) continue;  // does not move, so no force works on it
    const Eigen::Vector3d way = 0.5 * time_step_ * (toDouble(start.velocity) + toDouble(ice_.velocity(i)));
    const Eigen::Vector3d viscous = toDouble(ice_.viscousForce(i));
    work.internal += (toDouble(ice_.internalForce(i)) - viscous).dot(way);
    work.viscous += viscous.dot(way);
    work.drag += toDouble(water_.drag(start.velocity, water_.submerged(start.height))).dot(way);
    work.contact += toDouble(contact_.force(i)).dot(way);
    work.damping -= ice_.particleMass() * damping_per_s * toDouble(start.velocity).dot(way);
  }
}

void EnergyAudit::observeRig(const RigInstant& rig) {
  const Eigen::Vector3d way = rig.position_m - rig_.position_m;
  const double turn = rig.arm_angle_rad - rig_.arm_angle_rad;
  const Eigen::Vector3d on_rig = 0.5 * (rig_.contact.total() + rig.contact.total());
  const double fold_work = 0.5 * (rig_.contact.opening_moment_nm + rig.contact.opening_moment_nm) * turn;
  EnergyBalance& sum = rig_terms_;
  sum.crane_work_j += 0.5 * (rig_.support_n + rig.support_n).dot(way);
  sum.fold_work_j += fold_work;
  sum.work_on_ice_j += fold_work - on_rig.dot(way);
  const double mean_buoyancy = 0.5 * (rig_.buoyancy_n + rig.buoyancy_n);
  sum.rig_potential_j += (rig.weight_n - mean_buoyancy) * way.z();
  sum.contact_damper_j += rig.contact.damper_loss_j;
  sum.friction_j += rig.contact.friction_loss_j;
  rig_ = rig;
}

EnergyAudit::Stored EnergyAudit::stored() const {
  Stored sum;
  std::array<float, kComponents> stress{};
  std::vector<float> state(ice_.state().size());
  for (std::size_t i = 0; i < ice_.size(); ++i) {
    sum.kinetic += 0.5 * ice_.particleMass() * toDouble(ice_.velocity(i)).squaredNorm();
    const double height = ice_.position()[i].z();
    sum.weight += water_.weightPotential(height);
    sum.buoyancy += water_.buoyancyPotential(height);
    for (std::size_t c = 0; c < kComponents; ++c) stress[c] = ice_.stress()[c][i];
    for (std::size_t k = 0; k < state.size(); ++k) state[k] = ice_.state()[k][i];
    sum.elastic += static_cast<double>(ice_.volume()[i]) * material_.elasticEnergyDensity(stress, state);
  }
  return sum;
}

EnergyBalance EnergyAudit::balance() const {
  Work work;
  for (const Work& of_particle : work_) {
    work.stress += of_particle.stress;
    work.internal += of_particle.internal;
    work.viscous += of_particle.viscous;
    work.drag += of_particle.drag;
    work.contact += of_particle.contact;
    work.damping += of_particle.damping;
  }
  const Stored now = stored();
  EnergyBalance balance = rig_terms_;
  balance.rig_kinetic_j = 0.5 * (rig_.mass_kg * rig_.velocity_mps.squaredNorm() -
                                 first_rig_.mass_kg * first_rig_.velocity_mps.squaredNorm());
  balance.work_received_j = work.contact;
  balance.kinetic_j = now.kinetic - first_.kinetic;
  balance.weight_j = now.weight - first_.weight;
  balance.buoyancy_j = now.buoyancy - first_.buoyancy;
  balance.elastic_j = now.elastic - first_.elastic;
  balance.contact_spring_j = rig_.contact.spring_energy_j - first_rig_.contact.spring_energy_j;
  balance.plastic_j = work.stress - balance.elastic_j;
  balance.viscous_j = -work.viscous;
  balance.drag_j = -work.drag;
  balance.settle_damping_j = -work.damping;
  balance.discretisation_j = -work.internal - work.stress;
  return balance;
}

void RigInstant::visitState(StateVisitor& visitor) {
  visitor("position_m", position_m);
  visitor("velocity_mps", velocity_mps);
  visitor("support_n", support_n);
  visitor("arm_angle_rad", arm_angle_rad);
  visitor("mass_kg", mass_kg);
  visitor("weight_n", weight_n);
  visitor("buoyancy_n", buoyancy_n);
  contact.visitState(visitor);
}

/// What was there at the start is the same again in a world that is made anew.
void EnergyAudit::visitState(StateVisitor& visitor) {
  static_assert(sizeof(Work) == 6 * sizeof(double), "no padding");
  visitor.records("work_j", work_);
  rig_.visitState(visitor);
  for (const EnergyTerm& term : kEnergyTerms) visitor(term.name, rig_terms_.*term.value);
}

}  // namespace brash_ice_rig
