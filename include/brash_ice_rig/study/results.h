#pragma once

#include <string>
#include <vector>

#include "brash_ice_rig/study/run_pool.h"
#include "brash_ice_rig/study/study_file.h"

namespace brash_ice_rig {

/// The study's table, results.csv: one row per run, in the study's order, made from the runs' directories alone, so
/// that it does not depend on where and when they were made. Columns: case, seed, status; each scenario key in which
/// any two runs differ (but field.seed); what summary.json holds that is the same on every computer; the last row of
/// plug.csv. Cells of a failed run are empty from its figures on.
/// @param directory  of the study
/// @param statuses   one per run of the study, each done or failed
/// @throws OutputError if a file of a finished run cannot be read
std::string resultsCsv(const Study& study, const std::string& directory, const std::vector<RunStatus>& statuses);

}  // namespace brash_ice_rig
