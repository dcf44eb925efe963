#include "brash_ice_rig/output/run_files.h"

#include <cstdio>

namespace brash_ice_rig {

RunFiles::RunFiles(const Simulation& simulation, const std::string& directory) : writer_(simulation, directory) {
  if (simulation.scenario().output.vtk_interval_s <= 0.0) return;
  vtk_.emplace(directory + "/vtk");
  vtk_->writeIfDue(simulation, simulation.snapshot());
}

void RunFiles::write(const Simulation& simulation, const Snapshot& snapshot, StatusFlags raised) {
  writer_.write(snapshot, raised);
  writer_.writePlugIfDue(simulation, snapshot);
  if (vtk_) vtk_->writeIfDue(simulation, snapshot);
}

void RunFiles::finish(const Simulation& simulation, double compute_s, bool interrupted) {
  RunTiming timing;
  timing.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  timing.compute_s = compute_s;
  const RunSummary summary = writer_.finish(simulation, timing, interrupted);
  std::printf("%s\n%s\n%s\n%s\n%s\n", describe(summary).c_str(), writer_.scenarioPath().c_str(),
              writer_.forcePath().c_str(), writer_.plugPath().c_str(), writer_.summaryPath().c_str());
  if (vtk_) std::printf("%s\n", vtk_->collectionPath().c_str());
  std::fflush(stdout);
}

}  // namespace brash_ice_rig
