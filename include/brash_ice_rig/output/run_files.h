#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "brash_ice_rig/output/run_writer.h"
#include "brash_ice_rig/output/vtk_writer.h"
#include "brash_ice_rig/simulation/simulation.h"

namespace brash_ice_rig {

/// The files of one run from start or reset to its end: those of RunWriter, and VTK snapshots if the scenario asks for
/// them.
class RunFiles {
 public:
  /// Before the first advance(): the first VTK snapshot is that of the start.
  /// @param resumed  where the simulation was loaded from: the files go on as if it had never stopped, with all rows
  ///   from before; those of a checkpoint that has none begin now
  /// @throws OutputError, ConfigError where the checkpoint is not good
  RunFiles(const Simulation& simulation, const std::string& directory, CheckpointReader* resumed = nullptr);

  /// After each load-cell sample.
  /// @param raised  flags of the StepReport since the last call
  /// @throws OutputError
  void write(const Simulation& simulation, const Snapshot& snapshot, StatusFlags raised);

  /// Writes the summary and prints it on stdout with the paths of the files.
  /// @param compute_s  wall time spent in the simulation, s
  /// @throws OutputError
  void finish(const Simulation& simulation, double compute_s, bool interrupted);

  /// Adds what these files need to go on.
  /// @param compute_s  as in finish()
  /// @throws OutputError
  void save(CheckpointWriter& file, double compute_s);

  const std::string& directory() const { return writer_.directory(); }
  /// Where a checkpoint of this run belongs.
  std::string checkpointPath() const { return writer_.checkpointPath(); }

 private:
  void visitState(StateVisitor& visitor);
  double wallTime() const;

  RunWriter writer_;
  std::optional<VtkWriter> vtk_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  double wall_before_s_ = 0.0, compute_before_s_ = 0.0;  ///< of the run before it was resumed
};

}  // namespace brash_ice_rig
