#pragma once

#include <optional>
#include <string>

#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/simulation/simulation.h"

namespace brash_ice_rig {

/// Writes a run as a record (doc/records.md), as bag_to_record makes one of a recorded bag: NAME.csv with force and
/// motion as they grow; at the end NAME_rig.yaml, the effective scenario with its seeds, NAME_commands.csv, the
/// commands that the run heeded, NAME_motion.csv, a copy of procedure.motion_file if it has one, and NAME.yaml, the
/// manifest. Where there is no manifest, the run did not get to its end.
///
/// Use: one RecordWriter per run, made before the first advance(); one write() after each advance(samplePeriod());
/// finish() once. Every call throws OutputError and only that.
class RecordWriter {
 public:
  /// @param path  NAME, with or without .csv or .yaml; or an existing directory, or a path that ends with a slash: NAME
  ///   is then `record` in it. Directories that lack are made
  RecordWriter(const Simulation& simulation, const std::string& path);

  /// @param report  of the advance() since the last call
  void write(const Snapshot& snapshot, const StepReport& report);

  void finish(const Simulation& simulation);

  std::string csvPath() const { return base_ + ".csv"; }
  std::string manifestPath() const { return base_ + ".yaml"; }

 private:
  std::string base_;
  OutputFile csv_;
  std::string commands_;
  std::optional<double> empty_rig_n_;  ///< weight minus buoyancy where it hangs deepest
  double tared_n_ = 0.0;
  double last_time_s_ = 0.0;
};

}  // namespace brash_ice_rig
