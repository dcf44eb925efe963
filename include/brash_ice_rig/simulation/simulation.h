#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/rig/rig_commands.h"
#include "brash_ice_rig/simulation/checkpoint.h"
#include "brash_ice_rig/simulation/snapshot.h"

namespace brash_ice_rig {

/// What an advance() did.
struct StepReport {
  std::uint64_t steps = 0;
  StatusFlags flags;  ///< raised during this advance
  /// Taken up during this advance and heeded, from outside or from procedure.commands_file. A simulation of the same
  /// scenario to which they are given as that file repeats this one to the last bit.
  std::vector<RigCommand> commands;
};

/// Field, water and rig together. Knows nothing of ROS.
///
/// One thread owns it. The exceptions are setCraneVelocity(), setFoldTarget(), tare(), and those of load cell's noise
/// and resolution: any thread may call them; the last value counts and takes effect at the next step boundary.
/// Same scenario and same commands at the same steps give the same bits, for any number of threads.
class Simulation {
 public:
  /// @throws ConfigError if the scenario is not valid
  explicit Simulation(const Scenario& scenario);
  ~Simulation();
  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;

  const Scenario& scenario() const;

  /// Fixed time step, s; divides the load cell's sample period.
  double timeStep() const;
  /// Load cell's sample period, s: the natural length of an advance.
  double samplePeriod() const;
  std::size_t particleCount() const;
  std::uint64_t stepCount() const;
  /// Particles computed, summed over all steps: sleeping ones are not (solver.active_set).
  std::uint64_t activeParticleSteps() const;

  /// Velocity of the crane tip, m/s, frame map. Counts only in manual control without procedure.commands_file, for
  /// crane.command_timeout_s of simulated time; raises a flag otherwise. A value that is not finite is refused and
  /// stops the crane.
  void setCraneVelocity(const Eigen::Vector3d& velocity_mps);
  /// Fold ratio to go to, 0 folded .. 1 unfolded. Counts as a velocity does. Non-finite or outside 0..1 is refused.
  void setFoldTarget(double ratio);
  /// Makes the present reading zero from the next sample on.
  void tare();
  /// Standard deviation of the load cell's noise, N, from the next sample on. Counts, as a tare does, in any control.
  /// @param noise_n  in the range of load_cell.noise_n
  void setLoadCellNoise(double noise_n);
  /// The same for its resolution, N; 0: continuous.
  void setLoadCellResolution(double resolution_n);
  /// What holds from the next sample on, N.
  double loadCellNoise() const;
  double loadCellResolution() const;

  /// Runs the world on. Rounds to whole steps; never changes the step.
  /// The numerical guard stops the world before anything that cannot be leaves it: a speed beyond what height and crane
  /// can give, a volume that changes by half within a step, more kinetic energy than was put in, a force that is not
  /// finite (doc/reliability.md). It is frozen then, at the last good step: nothing moves any more and the flag stays.
  /// @param duration_s  simulated time, > 0
  StepReport advance(double duration_s);

  Snapshot snapshot() const;
  ParticleCloud particles() const;
  PlugSummary plug() const;
  PlugOutline plugOutline() const;

  /// The script has come to its end, or in manual control procedure.commands_file (never without), or the world is
  /// frozen.
  bool finished() const;
  bool frozen() const;
  /// What froze the world: which particle, where, what it would have done, and which key to change; empty until then.
  /// One line.
  const std::string& breakdown() const;

  /// 64-bit hash of everything that decides the future: what save() keeps, but for counts and the energy audit.
  std::uint64_t stateHash() const;

  /// Writes a checkpoint (checkpoint.h). A simulation that is loaded from it goes on as this one does, to the last bit.
  /// @throws OutputError, also where the world is frozen: it has no future
  void save(const std::string& path) const;
  /// @throws ConfigError naming the file and why it is refused: not ours, another format, damaged
  static Simulation load(const std::string& path);

  /// For whoever keeps more in the same file: adds this simulation's sections.
  void save(CheckpointWriter& file) const;
  /// @param threads  instead of the scenario's solver.threads, on which results do not depend
  static Simulation load(CheckpointReader& file, std::optional<int> threads = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace brash_ice_rig
