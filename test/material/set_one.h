#pragma once

#include "brash_ice_rig/ice/ice_scaling.h"
#include "brash_ice_rig/material/cap_model.h"

namespace brash_ice_rig {

/// Table 6, columns A-1, B-1, C-1 and D-1, as printed; moduli of B-1 at a thousandth of its stiffness.
inline CapParameters setOne(FlowRule flow_rule = FlowRule::kAssociated) {
  const ElasticModuli moduli = computeElasticModuli(0.901e6, 0.3);
  CapParameters p;
  p.flow_rule = flow_rule;
  p.alpha_pa = 200.0;
  p.theta = 0.396;
  p.aspect_ratio = 8.957;
  p.initial_intercept_pa = 2000.0;
  p.max_compaction = 0.093;
  p.d1_per_pa = 86.0e-6;
  p.d2_per_pa2 = 0.03e-12;
  p.bulk_modulus_pa = moduli.bulk_pa;
  p.shear_modulus_pa = moduli.shear_pa;
  return p;
}

/// Set 1 with the cap out of reach: the cone alone.
inline CapParameters coneOfSetOne() {
  CapParameters p = setOne();
  p.initial_intercept_pa = 1.0e8;
  return p;
}

}  // namespace brash_ice_rig
