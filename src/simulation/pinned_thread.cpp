#include "brash_ice_rig/simulation/pinned_thread.h"

#if defined(__linux__)
#include <pthread.h>
#include <sched.h>
#endif

namespace brash_ice_rig {

#if defined(__linux__)
namespace {

void allow(const std::vector<int>& cores) {
  cpu_set_t set;
  CPU_ZERO(&set);
  for (const int core : cores) CPU_SET(core, &set);
  // Only a core that has been taken away meanwhile could make this fail; then the thread stays as it is.
  pthread_setaffinity_np(pthread_self(), sizeof(set), &set);
}

}  // namespace

std::vector<int> allowedCores() {
  std::vector<int> cores;
  cpu_set_t set;
  if (pthread_getaffinity_np(pthread_self(), sizeof(set), &set) != 0) return cores;  // more cores than the set holds
  for (int core = 0; core < CPU_SETSIZE; ++core) {
    if (CPU_ISSET(core, &set)) cores.push_back(core);
  }
  return cores;
}

PinnedThread::PinnedThread(const std::vector<int>& cores, std::size_t index) {
  if (cores.empty()) return;
  before_ = allowedCores();
  allow({cores[index % cores.size()]});
}

PinnedThread::~PinnedThread() {
  if (!before_.empty()) allow(before_);
}
#else
std::vector<int> allowedCores() {
  return {};
}

PinnedThread::PinnedThread(const std::vector<int>&, std::size_t) {}

PinnedThread::~PinnedThread() {}
#endif

}  // namespace brash_ice_rig
