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
  /// Before the first advance(): the first VTK snapshot is that of the start. @throws OutputError
  RunFiles(const Simulation& simulation, const std::string& directory);

  /// After each load-cell sample.
  /// @param raised  flags of the StepReport since the last call
  /// @throws OutputError
  void write(const Simulation& simulation, const Snapshot& snapshot, StatusFlags raised);

  /// Writes the summary and prints it on stdout with the paths of the files.
  /// @param compute_s  wall time spent in the simulation, s
  /// @throws OutputError
  void finish(const Simulation& simulation, double compute_s, bool interrupted);

  const std::string& directory() const { return writer_.directory(); }

 private:
  RunWriter writer_;
  std::optional<VtkWriter> vtk_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace brash_ice_rig
