#include "brash_ice_rig/identify/thresholds.h"

namespace brash_ice_rig {

Thresholds identificationThresholds() {
  Thresholds t;
  // Screened lifts without an effect, of the blind generator's tune seeds, with six references. Of so few the largest
  // counts: ice that is stronger than the manifest says looks like bonds, because the simulator hardly rises with
  // cohesion.
  t.null_records = 12;
  t.own = {{"freeze_bonds", 24.0}, {"rate_dependence", 7.0}};
  return t;
}

}  // namespace brash_ice_rig
