#include "brash_ice_rig/simulation/waiting_threads.h"

#include <cstdlib>

#include <unistd.h>

namespace brash_ice_rig {

void letWaitingThreadsSleep(char** arguments) {
  constexpr const char* kPolicy = "OMP_WAIT_POLICY";
  constexpr const char* kSpins = "GOMP_SPINCOUNT";  // GCC's runtime; what it says goes before the policy
  if (std::getenv(kPolicy) != nullptr || std::getenv(kSpins) != nullptr) return;
  if (setenv(kPolicy, "passive", 1) != 0 || setenv(kSpins, "10000", 1) != 0) return;
  execv("/proc/self/exe", arguments);
}

}  // namespace brash_ice_rig
