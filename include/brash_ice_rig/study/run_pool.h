#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "brash_ice_rig/config/scenario.h"

namespace brash_ice_rig {

/// A run to be made: what `brash_ice run` leaves of this scenario goes into this directory.
struct RunJob {
  std::string directory;  ///< absolute, no two alike; where processes share, on a file system that all see
  Scenario scenario;      ///< valid and scripted
};

/// Long for a file system that is slow now and then, short beside a campaign.
constexpr double kDefaultLeaseS = 30.0;

enum class RunState { kWaiting, kRunning, kDone, kFailed };

struct RunStatus {
  RunState state = RunState::kWaiting;
  std::string note;        ///< kFailed: why; kWaiting: why an earlier run does not count, empty if there is none
  bool earlier = false;    ///< kDone, kFailed: from an earlier attempt
  bool elsewhere = false;  ///< kDone, kFailed: made by another process in the meantime
};

struct RunPoolOptions {
  std::string program = "/proc/self/exe";  ///< brash_ice
  int children = 1;                        ///< programs that run at a time; > 0
  bool shared = false;                     ///< other processes make runs of the same list
  double lease_s = kDefaultLeaseS;  ///< a process that shows no sign of life for so long is taken for dead, s; > 0
  std::function<bool()> stop;       ///< says true when all is to end; asked every 20 ms
  std::function<void(std::size_t)> changed = [](std::size_t) {};  ///< the status of this job is a new one
  std::function<void()> tick = [] {};                             ///< every 20 ms
};

/// What earlier attempts have left of the jobs: done or to be made. A run whose world froze has failed for good.
/// @param repeat_failed  make those again
std::vector<RunStatus> findEarlierRuns(const std::vector<RunJob>& jobs, const std::string& program, bool repeat_failed);

/// Has all runs made that wait, several at a time, each in a child process of its own: one that crashes or fails does
/// not harm the others. Other processes, on other computers too, may call this with the same jobs: each run is made by
/// one of them (study/claims.h) and all return when the last is done. What a process had at work when it died, the
/// others make again. A run that failed elsewhere counts as failed for all who were at work at that time. No child
/// outlives its parent, however that ends.
/// @param statuses  one per job; kept up to date. After a stop, what was not finished waits again.
void makeRuns(const std::vector<RunJob>& jobs, const RunPoolOptions& options, std::vector<RunStatus>& statuses);

}  // namespace brash_ice_rig
