#include "brash_ice_rig/simulation/waiting_threads.h"

#include <cstdlib>

#include <unistd.h>

namespace brash_ice_rig {

void letWaitingThreadsSleep(char** arguments) {
  constexpr const char* kVariable = "OMP_WAIT_POLICY";
  if (std::getenv(kVariable) != nullptr || setenv(kVariable, "passive", 1) != 0) return;
  execv("/proc/self/exe", arguments);
}

}  // namespace brash_ice_rig
