#include "brash_ice_rig/rig/contact.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {

double frictionCoefficient(const ContactConfig& config, double sliding_mps) {
  return config.friction_dynamic +
         (config.friction_static - config.friction_dynamic) * repeatable::exp(-config.friction_decay_spm * sliding_mps);
}

RigContact::RigContact(const ContactConfig& config, const CollectorConfig& collector, double bulk_modulus_pa,
                       double spacing_m, double particle_mass_kg, std::size_t particle_count)
    : config_(config),
      stiffness_(std::max(config.stiffness_ratio * bulk_modulus_pa * spacing_m, config.min_stiffness_npm)),
      damping_(2.0 * config.damping_ratio * std::sqrt(stiffness_ * particle_mass_kg)),
      offset_(0.5 * spacing_m),
      pole_radius_(collector.pole_radius_m),
      pole_length_(collector.pole_length_m),
      force_(particle_count, Eigen::Vector4f::Zero()),
      net_memory_(particle_count),
      pole_memory_(particle_count) {}

ContactSum RigContact::update(double time_step_s, const SphBody& ice, const Collector& collector,
                              const Eigen::Vector3d& hub_position_m, const Eigen::Vector3d& hub_velocity_mps) {
  assert(ice.size() == force_.size());
  for (const std::size_t i : touched_) force_[i].setZero();
  touched_.clear();

  ContactSum sum;
  const double arm_reach = collector.armLength() + 2.0 * offset_;
  const double pole_reach = pole_radius_ + offset_;
  for (std::size_t i = 0; i < ice.size(); ++i) {
    const Eigen::Vector3d offset = ice.position()[i] - hub_position_m;
    const double plan_squared = offset.head<2>().squaredNorm();
    if (plan_squared > arm_reach * arm_reach || ice.isFixed(i)) continue;
    const Eigen::Vector3d velocity = ice.velocity(i).head<3>().cast<double>();
    // Books one touch, of net or pole, on the particle and on the rig; returns the force on the ice.
    const auto press = [&](const Touch& touch, Memory& memory) -> Eigen::Vector3d {
      const Forces on_ice = resolve(time_step_s, touch, velocity, memory, sum);
      Eigen::Vector3d total = on_ice.normal + on_ice.friction;
      force_[i].head<3>() += total.cast<float>();
      sum.normal_n -= on_ice.normal;
      sum.friction_n -= on_ice.friction;
      sum.deepest_m = std::max(sum.deepest_m, touch.penetration_m);
      touched_.push_back(i);
      return total;
    };

    // Ends a contact; its damper still acted in half of the way since the last update.
    const auto release = [&](Memory& memory, const Eigen::Vector3d& surface_velocity_mps) {
      sum.damper_loss_j += 0.5 * time_step_s * memory.damper_n.dot(velocity - surface_velocity_mps);
      memory = Memory();
    };

    Memory& net = net_memory_[i];
    if (std::abs(offset.z()) < arm_reach) {
      const NetPoint point = collector.nearestNetPoint(offset);
      const Eigen::Vector3d away = offset - point.offset_m;
      Touch touch;
      touch.surface_velocity_mps = hub_velocity_mps + point.velocity_mps;
      const double height = point.normal.dot(away);
      const std::int8_t side = net.side != 0 ? net.side : static_cast<std::int8_t>(height >= 0.0 ? 1 : -1);
      const double distance = away.norm();
      if (point.on_rim && distance > 0.0) {
        touch.normal = away / distance;
        touch.penetration_m = offset_ - distance;
      } else {
        // Beside or below the triangle the distance to its nearest point counts, over it the height on the
        // remembered side, which is negative once the particle has been pressed through.
        const bool over = distance - std::abs(height) < 1.0e-9 * offset_ + 1.0e-6 * distance;
        touch.normal = over ? Eigen::Vector3d(side * point.normal) : Eigen::Vector3d(away / distance);
        touch.penetration_m = offset_ - (over ? side * height : distance);
      }
      if (touch.penetration_m > 0.0) {
        net.side = side;
        sum.opening_moment_nm += press(touch, net).dot(point.arm_turn_m);
      } else {
        release(net, touch.surface_velocity_mps);
      }
    } else if (net.side != 0) {
      release(net, hub_velocity_mps);
    }

    Memory& pole = pole_memory_[i];
    if (plan_squared < pole_reach * pole_reach && offset.z() > 0.0 && offset.z() < pole_length_) {
      const double distance = std::sqrt(plan_squared);
      Touch touch;
      touch.normal = distance > 0.0 ? Eigen::Vector3d(offset.x() / distance, offset.y() / distance, 0.0)
                                    : Eigen::Vector3d::UnitX();
      touch.penetration_m = pole_reach - distance;
      touch.surface_velocity_mps = hub_velocity_mps;
      pole.side = 1;
      press(touch, pole);
    } else if (pole.side != 0) {
      release(pole, hub_velocity_mps);
    }
  }
  return sum;
}

RigContact::Forces RigContact::resolve(double time_step_s, const Touch& touch, const Eigen::Vector3d& velocity,
                                       Memory& memory, ContactSum& sum) const {
  const Eigen::Vector3d relative = velocity - touch.surface_velocity_mps;
  const double approach = touch.normal.dot(relative);
  const double elastic_push = stiffness_ * touch.penetration_m;
  const double push = std::max(elastic_push - damping_ * approach, 0.0);

  const Eigen::Vector3d sliding = relative - approach * touch.normal;
  Eigen::Vector3d& spring = memory.spring_m;
  const Eigen::Vector3d old_spring = spring;
  spring -= touch.normal.dot(spring) * touch.normal;
  spring += time_step_s * sliding;
  const double tangential_stiffness = config_.tangential_stiffness_ratio * stiffness_;
  const double grip = frictionCoefficient(config_, sliding.norm()) * push;
  const double pull = tangential_stiffness * spring.norm();
  const Eigen::Vector3d stretched = spring;
  if (pull > grip) spring *= grip / pull;

  sum.spring_energy_j += 0.5 * elastic_push * touch.penetration_m + 0.5 * tangential_stiffness * spring.squaredNorm();
  const Eigen::Vector3d damper = (elastic_push - push) * touch.normal;
  sum.damper_loss_j += 0.5 * time_step_s * (memory.damper_n + damper).dot(relative);
  memory.damper_n = damper;
  sum.friction_loss_j += 0.5 * tangential_stiffness * (old_spring + spring).dot(stretched - spring);
  return {push * touch.normal, -tangential_stiffness * spring};
}

void ContactSum::visitState(StateVisitor& visitor) {
  visitor("normal_n", normal_n);
  visitor("friction_n", friction_n);
  visitor("opening_moment_nm", opening_moment_nm);
  visitor("deepest_m", deepest_m);
  visitor("spring_energy_j", spring_energy_j);
  visitor("damper_loss_j", damper_loss_j);
  visitor("friction_loss_j", friction_loss_j);
}

void RigContact::visitState(StateVisitor& visitor) {
  visitor.records("force_n", force_);
  visitMemory(visitor, net_memory_);
  visitMemory(visitor, pole_memory_);
  if (!visitor.loading()) return;
  touched_.clear();
  for (std::size_t i = 0; i < force_.size(); ++i) {
    if (!force_[i].isZero(0.0f)) touched_.push_back(i);
  }
}

/// Only those in contact remember anything, and they are few.
void RigContact::visitMemory(StateVisitor& visitor, std::vector<Memory>& memory) {
  std::vector<std::int8_t> side;
  side.reserve(memory.size());
  for (const Memory& of_particle : memory) side.push_back(of_particle.side);
  visitor("side", side);
  for (std::size_t i = 0; i < memory.size(); ++i) {
    if (visitor.loading()) memory[i] = Memory();
    memory[i].side = side[i];
    if (side[i] == 0) continue;
    visitor("spring_m", memory[i].spring_m);
    visitor("damper_n", memory[i].damper_n);
  }
}

}  // namespace brash_ice_rig
