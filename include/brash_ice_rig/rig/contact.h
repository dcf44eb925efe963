#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/rig/collector.h"
#include "brash_ice_rig/sph/sph_body.h"
#include "brash_ice_rig/system/state_visitor.h"

namespace brash_ice_rig {

/// eq. 4: friction falls from the static to the dynamic value with the sliding speed.
/// @param sliding_mps  >= 0
double frictionCoefficient(const ContactConfig& config, double sliding_mps);

/// Sum of the contact over all particles, as the ice acts on the rig.
struct ContactSum {
  Eigen::Vector3d normal_n = Eigen::Vector3d::Zero();    ///< frame map
  Eigen::Vector3d friction_n = Eigen::Vector3d::Zero();  ///< frame map
  double opening_moment_nm = 0.0;  ///< on all arms about their hinges, > 0 presses them down and open
  double deepest_m = 0.0;          ///< largest penetration
  double spring_energy_j = 0.0;    ///< held by normal and friction springs
  double damper_loss_j = 0.0;      ///< since the last update
  double friction_loss_j = 0.0;    ///< by slip, since the last update
  Eigen::Vector3d total() const { return normal_n + friction_n; }

  void visitState(StateVisitor& visitor);
};

/// Penalty contact, particle to net and particle to pole, at half a spacing from their surfaces (section 4.1).
///
/// The normal force is that of a spring and a dashpot that only push. Friction is a tangential spring whose deflection
/// is remembered while the contact lasts, cut off at mu times the normal force: a friction that depends on speed alone
/// never reaches mu at small steps. A particle also remembers from which side it met the net, so that the net cannot
/// be passed by pressing through it.
class RigContact {
 public:
  /// @param bulk_modulus_pa  as used in the step, i.e. scaled
  RigContact(const ContactConfig& config, const CollectorConfig& collector, double bulk_modulus_pa, double spacing_m,
             double particle_mass_kg, std::size_t particle_count);

  /// Computes the force on each particle. Serial, in particle order, so that the sum repeats bit for bit.
  ContactSum update(double time_step_s, const SphBody& ice, const Collector& collector,
                    const Eigen::Vector3d& hub_position_m, const Eigen::Vector3d& hub_velocity_mps);

  /// N on particle i, w = 0.
  const Eigen::Vector4f& force(std::size_t i) const { return force_[i]; }

  double normalStiffness() const { return stiffness_; }
  /// Distance from the surface at which contact begins, m.
  double offset() const { return offset_; }

  void visitState(StateVisitor& visitor);

 private:
  struct Memory {
    Eigen::Vector3d spring_m = Eigen::Vector3d::Zero();
    Eigen::Vector3d damper_n = Eigen::Vector3d::Zero();  ///< its force on the rig at the last update
    std::int8_t side = 0;                                ///< 0: no contact
  };
  static void visitMemory(StateVisitor& visitor, std::vector<Memory>& memory);
  struct Touch {
    Eigen::Vector3d normal;  ///< unit, from the surface to the particle
    double penetration_m;
    Eigen::Vector3d surface_velocity_mps;
  };
  struct Forces {
    Eigen::Vector3d normal, friction;
  };
  /// @param sum  gets the energies of this touch
  Forces resolve(double time_step_s, const Touch& touch, const Eigen::Vector3d& velocity, Memory& memory,
                 ContactSum& sum) const;

  ContactConfig config_;
  double stiffness_, damping_, offset_;
  double pole_radius_, pole_length_;
  AlignedVector<Eigen::Vector4f> force_;
  std::vector<Memory> net_memory_, pole_memory_;
  std::vector<std::size_t> touched_;  ///< particles with a force from the last update
};

}  // namespace brash_ice_rig
