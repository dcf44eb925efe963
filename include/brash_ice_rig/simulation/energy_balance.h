#pragma once

#include <array>

namespace brash_ice_rig {

/// Where the energy of a run has gone since its start, J. Definitions: doc/theory.md, section Energy.
struct EnergyBalance {
  // Put in from outside.
  double crane_work_j = 0.0;  ///< tension times way of the crane tip
  double fold_work_j = 0.0;   ///< of the folding arms on the ice
  // Kept by the rig.
  double rig_potential_j = 0.0;  ///< weight less buoyancy of collector and pole
  double rig_kinetic_j = 0.0;
  // From net and pole to the ice.
  double work_on_ice_j = 0.0;     ///< contact forces along the way of net and pole
  double contact_spring_j = 0.0;  ///< kept by the springs of the contact
  double contact_damper_j = 0.0;  ///< lost
  double friction_j = 0.0;        ///< lost by slip
  double work_received_j = 0.0;   ///< contact forces along the way of the particles
  // Kept by the ice.
  double kinetic_j = 0.0;
  double weight_j = 0.0;    ///< potential energy of weight
  double buoyancy_j = 0.0;  ///< potential energy of buoyancy
  double elastic_j = 0.0;
  // Lost in the ice.
  double plastic_j = 0.0;         ///< work of stress on strain that is not kept as elastic energy
  double viscous_j = 0.0;         ///< artificial viscosity
  double drag_j = 0.0;            ///< of the water
  double settle_damping_j = 0.0;  ///< mass damping
  double discretisation_j = 0.0;  ///< work against the stress forces on particles, less work of stress on strain

  /// What goes into rig, contact or ice less what is found there, J: 0 but for what the time step leaves.
  double rigImbalance() const { return crane_work_j + fold_work_j - rig_potential_j - rig_kinetic_j - work_on_ice_j; }
  double contactImbalance() const {
    return work_on_ice_j - contact_spring_j - contact_damper_j - friction_j - work_received_j;
  }
  double iceImbalance() const {
    return work_received_j - kinetic_j - weight_j - buoyancy_j - elastic_j - plastic_j - viscous_j - drag_j -
           settle_damping_j - discretisation_j;
  }
  /// Of the whole, J.
  double imbalance() const { return rigImbalance() + contactImbalance() + iceImbalance(); }
  /// Imbalance over |crane work|; NaN before the crane has done any.
  double imbalanceRatio() const;
};

/// One term of the balance by name.
struct EnergyTerm {
  const char* name;  ///< that of the member
  double EnergyBalance::*value;
};

/// All terms, in the order of the struct.
extern const std::array<EnergyTerm, 18> kEnergyTerms;

}  // namespace brash_ice_rig
