#include "brash_ice_rig/system/launcher.h"

#include <cstdlib>

namespace brash_ice_rig {
namespace {

/// A variable's whole number; 0 where it is not set or something else.
int numberFrom(const char* variable) {
  const char* text = std::getenv(variable);
  return text == nullptr ? 0 : static_cast<int>(std::strtol(text, nullptr, 10));
}

}  // namespace

LaunchedTogether launchedTogether() {
  constexpr const char* kVariables[][2] = {{"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"},
                                           {"PMI_RANK", "PMI_SIZE"},
                                           {"SLURM_PROCID", "SLURM_STEP_NUM_TASKS"}};
  for (const auto& [rank, size] : kVariables) {
    if (numberFrom(size) > 1) return {numberFrom(rank), numberFrom(size)};
  }
  return {};
}

}  // namespace brash_ice_rig
