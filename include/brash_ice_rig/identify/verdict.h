#pragma once

#include "brash_ice_rig/identify/identification.h"
#include "brash_ice_rig/identify/record_check.h"
#include "brash_ice_rig/identify/thresholds.h"

namespace brash_ice_rig {

/// Whether a residual means anything: its chi², or its correlation where chi² is not small.
bool isSignificant(double chi2_per_bin, double portmanteau_p, const Thresholds& thresholds);

/// Decides from the ranking and the residual of the refitted baseline: fills verdict, effects, accepted, significant,
/// and evidence_of_both of the ranking.
/// @param report  on the first record: of part of a lift, finding nothing does not mean that nothing is missing
void decide(Identification& result, const RecordReport& report, const Thresholds& thresholds);

/// Says it in sentences, and what to measure next: fills summary and next_experiment.
void describe(Identification& result, const Thresholds& thresholds);

}  // namespace brash_ice_rig
