#pragma once

#include <cstddef>
#include <vector>

namespace brash_ice_rig {

/// Numbers of the processor cores that the calling thread may run on, ascending; empty where the system does not tell
/// (other than Linux).
std::vector<int> allowedCores();

/// Keeps the calling thread on one core as long as it lives; then the thread may run where it could before.
class PinnedThread {
 public:
  /// @param cores  allowedCores() of the team's first thread; if empty, nothing is pinned
  /// @param index  of the thread in its team; those beyond the last core begin at the first again
  PinnedThread(const std::vector<int>& cores, std::size_t index);
  ~PinnedThread();
  PinnedThread(const PinnedThread&) = delete;
  PinnedThread& operator=(const PinnedThread&) = delete;

 private:
  std::vector<int> before_;
};

}  // namespace brash_ice_rig
