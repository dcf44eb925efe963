#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/identify/record.h"

namespace brash_ice_rig {

/// A record made ready to be driven again.
struct Replay {
  /// The record is a run of this simulation, and its commands are repeated: without changes, by the same build, the
  /// same bits come out. Otherwise the lift follows hoist_position_m.
  bool exact = false;
  Scenario scenario;                 ///< to run
  std::string scenario_file;         ///< replay.yaml, which holds it
  std::string measured_file;         ///< measured.csv
  std::vector<double> time_s;        ///< of the simulated test, increasing
  std::vector<double> force_n;       ///< measured, at these times, with the simulated load cell's zero
  std::vector<std::string> remarks;  ///< what was decided on the way, a sentence each
};

/// Composes the scenario of a record (its rig and ice, then changes, which win), and leaves in a directory replay.yaml,
/// the motion or the commands, and measured.csv (time_s of the simulated test, force_n, hoist_position_m).
///
/// Of a foreign record, the lift is replayed: from its first row, or, where the collector is lowered first, from the
/// end of the lowering, with the rig of the scenario unfolded under the ice. The hoist is averaged over 0.1 s. The tare
/// of the record is replaced by the weight less buoyancy of the scenario's rig, and an offset of its clock, where
/// known, taken off.
/// @param changes  file is ignored
/// @throws ConfigError naming what is wrong: of a foreign record whatever checkRecord() refuses; OutputError
Replay prepareReplay(const Record& record, const ScenarioSources& changes, const std::string& directory);

/// How a simulated force compares with the measured one.
struct ReplayComparison {
  std::size_t samples = 0;    ///< simulated ones, within the time of the measured
  std::size_t identical = 0;  ///< of these, with the same bits at a measured time
  double rms_n = 0.0;         ///< of the difference
};

/// @param time_s, force_n  simulated; strictly increasing
ReplayComparison compareForces(const Replay& replay, const std::vector<double>& time_s,
                               const std::vector<double>& force_n);

}  // namespace brash_ice_rig
