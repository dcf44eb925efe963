#pragma once

#include <limits>
#include <string>
#include <vector>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/simulation/simulation.h"

namespace brash_ice_rig {

/// Particles as VTK XML PolyData (.vtp): one vertex each, with the cloud's fields as point data.
std::string particlesToVtp(const ParticleCloud& cloud);

/// Net (eight triangles from the hub) and pole (a line to the crane tip) as VTK XML PolyData.
std::string collectorToVtp(const CollectorConfig& collector, const RigState& rig);

/// A time series that ParaView opens as one: DIRECTORY/run.pvd, with an ice and a collector file per instant.
/// run.pvd is replaced as a whole after each instant, so that the series of a stopped run can be read too.
class VtkWriter {
 public:
  /// Creates the directory. @throws OutputError
  explicit VtkWriter(const std::string& directory);

  /// @throws OutputError
  void write(double time_s, const ParticleCloud& cloud, const CollectorConfig& collector, const RigState& rig);

  /// write() at the first call and then at every multiple of output.vtk_interval_s, counted from time 0 as the test's
  /// time is. @throws OutputError
  void writeIfDue(const Simulation& simulation, const Snapshot& snapshot);

  /// For a checkpoint, which holds no pictures: those that a resumed run does not find in its directory are left out of
  /// the series.
  void visitState(StateVisitor& visitor);

  std::string collectionPath() const { return directory_ + "/run.pvd"; }

 private:
  std::string directory_;
  std::vector<double> times_s_;  ///< NaN: not in the series
  double due_s_ = -std::numeric_limits<double>::infinity();
};

}  // namespace brash_ice_rig
