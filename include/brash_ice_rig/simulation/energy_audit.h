#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/material/material.h"
#include "brash_ice_rig/rig/contact.h"
#include "brash_ice_rig/simulation/energy_balance.h"
#include "brash_ice_rig/sph/sph_body.h"
#include "brash_ice_rig/water/water.h"

namespace brash_ice_rig {

/// The rig at one instant, as the audit needs it.
struct RigInstant {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< of the crane tip
  Eigen::Vector3d velocity_mps = Eigen::Vector3d::Zero();
  Eigen::Vector3d support_n = Eigen::Vector3d::Zero();  ///< of the crane on the rig
  double arm_angle_rad = 0.0;
  double mass_kg = 0.0;
  double weight_n = 0.0;    ///< > 0
  double buoyancy_n = 0.0;  ///< > 0
  ContactSum contact;

  void visitState(StateVisitor& visitor);
};

/// Follows where the energy of a run goes, step by step (doc/theory.md, section Energy). It only watches: the run is
/// the same to the last bit with it and without.
///
/// Each force on a particle works along the mean of its velocities before and after the step, which makes the sum of
/// the works the change of kinetic energy, exactly. Each term is found on its own, from forces and states: the
/// imbalance is a check. Sums are kept per particle, so that they do not depend on the number of threads.
class EnergyAudit {
 public:
  /// All zero at the present state. The parts must outlive the audit.
  EnergyAudit(double time_step_s, const SphBody& ice, const Material& material, const ParticleInWater& water,
              const RigContact& contact, const RigInstant& rig);

  /// Team (see SphBody). After updateGradients(), before updateStress().
  void beginStep();
  /// Team. After updateMotion(), before the contact forces change.
  /// @param damping_per_s  as in updateMotion()
  void endStep(double damping_per_s);
  /// One thread. The rig has moved and the forces between rig and ice are up to date.
  void observeRig(const RigInstant& rig);

  /// Since the start, J.
  EnergyBalance balance() const;

  void visitState(StateVisitor& visitor);

 private:
  /// J, since the start.
  struct Work {
    double stress = 0.0;    ///< V sigma : strain increment
    double internal = 0.0;  ///< of the stress forces on the particle, > 0 when they drive it
    double viscous = 0.0, drag = 0.0, contact = 0.0, damping = 0.0;  ///< likewise
  };
  /// What a step starts from.
  struct Start {
    Eigen::Vector4f velocity;
    float height;
    Eigen::Matrix3d strain;  ///< increment of the step
  };
  struct Stored {
    double kinetic = 0.0, weight = 0.0, buoyancy = 0.0, elastic = 0.0;
  };
  Stored stored() const;

  double time_step_;
  const SphBody& ice_;
  const Material& material_;
  const ParticleInWater& water_;
  const RigContact& contact_;
  std::vector<Work> work_;
  AlignedVector<Start> start_;
  Stored first_;
  RigInstant first_rig_, rig_;
  EnergyBalance rig_terms_;  ///< those that observeRig() adds up
};

}  // namespace brash_ice_rig
