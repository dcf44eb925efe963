#include "brash_ice_rig/output/run_files.h"

#include <cstdio>

namespace brash_ice_rig {

namespace {
constexpr char kSection[] = "files";
}

RunFiles::RunFiles(const Simulation& simulation, const std::string& directory, CheckpointReader* resumed)
    : writer_(simulation, directory) {
  const bool with_vtk = simulation.scenario().output.vtk_interval_s > 0.0;
  if (with_vtk) vtk_.emplace(directory + "/vtk");
  if (resumed != nullptr && resumed->has(kSection)) {
    resumed->read(kSection, [this](StateVisitor& visitor) { visitState(visitor); });
  } else if (with_vtk) {
    vtk_->writeIfDue(simulation, simulation.snapshot());
  }
}

void RunFiles::save(CheckpointWriter& file, double compute_s) {
  // What the two are at this instant, for the walk.
  const double wall_before_s = wall_before_s_, compute_before_s = compute_before_s_;
  wall_before_s_ = wallTime();
  compute_before_s_ += compute_s;
  file.add(kSection, [this](StateVisitor& visitor) { visitState(visitor); });
  wall_before_s_ = wall_before_s;
  compute_before_s_ = compute_before_s;
}

void RunFiles::visitState(StateVisitor& visitor) {
  visitor("wall_s", wall_before_s_);
  visitor("compute_s", compute_before_s_);
  writer_.visitState(visitor);
  if (vtk_) vtk_->visitState(visitor);
}

double RunFiles::wallTime() const {
  return wall_before_s_ + std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

void RunFiles::write(const Simulation& simulation, const Snapshot& snapshot, StatusFlags raised) {
  writer_.write(snapshot, raised);
  writer_.writePlugIfDue(simulation, snapshot);
  if (vtk_) vtk_->writeIfDue(simulation, snapshot);
}

void RunFiles::finish(const Simulation& simulation, double compute_s, bool interrupted) {
  RunTiming timing;
  timing.wall_s = wallTime();
  timing.compute_s = compute_before_s_ + compute_s;
  const RunSummary summary = writer_.finish(simulation, timing, interrupted);
  std::printf("%s\n%s\n%s\n%s\n%s\n", describe(summary).c_str(), writer_.scenarioPath().c_str(),
              writer_.forcePath().c_str(), writer_.plugPath().c_str(), writer_.summaryPath().c_str());
  if (vtk_) std::printf("%s\n", vtk_->collectionPath().c_str());
  std::fflush(stdout);
}

}  // namespace brash_ice_rig
