#include "brash_ice_rig/identify/thresholds.h"

namespace brash_ice_rig {

Thresholds identificationThresholds() {
  return {};
}

Discrepancy identificationDiscrepancy() {
  return {};
}

}  // namespace brash_ice_rig
