#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/study/message_passing.h"

namespace brash_ice_rig {

/// A run to be made: what `brash_ice run` leaves of this scenario goes into this directory.
struct RunJob {
  std::string directory;  ///< absolute, no two alike; with MPI on a file system that all processes see
  Scenario scenario;      ///< valid and scripted
};

enum class RunState { kWaiting, kRunning, kDone, kFailed };

struct RunStatus {
  RunState state = RunState::kWaiting;
  std::string note;      ///< kFailed: why; kWaiting: why an earlier run does not count, empty if there is none
  bool earlier = false;  ///< kDone, kFailed: from an earlier attempt
};

struct RunPoolOptions {
  std::string program = "/proc/self/exe";  ///< brash_ice
  int children = 1;                        ///< programs that run at a time, per process of MPI; > 0
  std::function<bool()> stop;              ///< says true when all is to end; asked every 20 ms
  std::function<void(std::size_t)> changed = [](std::size_t) {};  ///< the status of this job is a new one
  std::function<void()> tick = [] {};                             ///< every 20 ms
};

/// What earlier attempts have left of the jobs: done or to be made. A run whose world froze has failed for good.
/// @param repeat_failed  make those again
std::vector<RunStatus> findEarlierRuns(const std::vector<RunJob>& jobs, const std::string& program, bool repeat_failed);

/// Makes all runs that wait, several at a time, each in a child process of its own: one that crashes or fails does not
/// harm the others. With MPI the other processes, which are in serveRuns(), make their share. No child outlives its
/// parent, however that ends.
/// @param statuses  one per job; kept up to date. After a stop, what was not finished waits again.
/// @throws std::runtime_error if the processes of MPI are different programs
void makeRuns(const std::vector<RunJob>& jobs, const RunPoolOptions& options, MessagePassing& messages,
              std::vector<RunStatus>& statuses);

/// On the processes of MPI other than the first: makes the runs that it hands out until it says stop.
void serveRuns(const RunPoolOptions& options, MessagePassing& messages);

}  // namespace brash_ice_rig
