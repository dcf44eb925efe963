#include "brash_ice_rig/simulation/energy_balance.h"

#include <cmath>
#include <limits>

namespace brash_ice_rig {

const std::array<EnergyTerm, 18> kEnergyTerms = {{
    {"crane_work_j", &EnergyBalance::crane_work_j},
    {"fold_work_j", &EnergyBalance::fold_work_j},
    {"rig_potential_j", &EnergyBalance::rig_potential_j},
    {"rig_kinetic_j", &EnergyBalance::rig_kinetic_j},
    {"work_on_ice_j", &EnergyBalance::work_on_ice_j},
    {"contact_spring_j", &EnergyBalance::contact_spring_j},
    {"contact_damper_j", &EnergyBalance::contact_damper_j},
    {"friction_j", &EnergyBalance::friction_j},
    {"work_received_j", &EnergyBalance::work_received_j},
    {"kinetic_j", &EnergyBalance::kinetic_j},
    {"weight_j", &EnergyBalance::weight_j},
    {"buoyancy_j", &EnergyBalance::buoyancy_j},
    {"elastic_j", &EnergyBalance::elastic_j},
    {"plastic_j", &EnergyBalance::plastic_j},
    {"viscous_j", &EnergyBalance::viscous_j},
    {"drag_j", &EnergyBalance::drag_j},
    {"settle_damping_j", &EnergyBalance::settle_damping_j},
    {"discretisation_j", &EnergyBalance::discretisation_j},
}};

double EnergyBalance::imbalanceRatio() const {
  return crane_work_j != 0.0 ? imbalance() / std::abs(crane_work_j) : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace brash_ice_rig
