#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/output/run_summary.h"
#include "brash_ice_rig/simulation/simulation.h"

namespace brash_ice_rig {

/// Wall time of a run, s.
struct RunTiming {
  double wall_s = 0.0;     ///< from start to end, waiting included
  double compute_s = 0.0;  ///< inside Simulation::advance() only
};

/// Leaves a run's files in a directory: scenario.yaml at once, force.csv and plug.csv as they grow, summary.json at the
/// end; beside force.csv energy.csv, if the scenario asks for it.
/// Where there is no summary.json, the run did not get to its end: one from an earlier run is removed at the start.
///
/// Use: one RunWriter per run, made before the first advance(); after each advance(samplePeriod()) one write()
/// and one writePlugIfDue(); finish() once. Every call throws OutputError (directory not writable, disk full...) and
/// only that.
class RunWriter {
 public:
  /// Creates the directory, parents too, and writes scenario.yaml, the effective scenario.
  RunWriter(const Simulation& simulation, const std::string& directory);

  /// For a checkpoint, which holds the tables too: whoever loads it gets them whole, wherever they go then. Loading:
  /// before the first write().
  void visitState(StateVisitor& visitor);

  /// One row of force.csv (and of energy.csv), one sample of the statistics.
  /// @param raised  flags of the StepReport since the last call; they and the snapshot's go into the summary
  void write(const Snapshot& snapshot, StatusFlags raised);

  /// One row of plug.csv at the first call at or after time 0 and then at every half second of the test's time.
  void writePlugIfDue(const Simulation& simulation, const Snapshot& snapshot);

  /// Closes the tables and writes summary.json.
  /// @param interrupted  stopped from outside before the script's end
  RunSummary finish(const Simulation& simulation, const RunTiming& timing, bool interrupted);

  const std::string& directory() const { return directory_; }
  std::string scenarioPath() const { return directory_ + "/scenario.yaml"; }
  std::string forcePath() const { return directory_ + "/force.csv"; }
  std::string energyPath() const { return directory_ + "/energy.csv"; }
  std::string plugPath() const { return directory_ + "/plug.csv"; }
  std::string summaryPath() const { return directory_ + "/summary.json"; }
  std::string checkpointPath() const { return directory_ + "/" + kCheckpointName; }

 private:
  std::string directory_;
  OutputFile force_file_, plug_file_;
  std::optional<OutputFile> energy_file_;
  std::optional<EnergyBalance> energy_;  ///< of the last row
  ForceStatistics reading_, ice_;
  StatusFlags flags_;
  double sample_period_s_;
  std::uint64_t first_step_;
  std::uint64_t first_active_particle_steps_;
  std::uint64_t rows_since_flush_ = 0;
  double plug_due_s_ = 0.0;
};

}  // namespace brash_ice_rig
