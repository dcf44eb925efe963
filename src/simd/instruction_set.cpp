#include "brash_ice_rig/simd/instruction_set.h"

#include <cstdlib>
#include <cstring>

namespace brash_ice_rig {

const char* nameOf(InstructionSet set) {
  switch (set) {
    case InstructionSet::kAvx512:
      return "avx512";
    case InstructionSet::kAvx2:
      return "avx2";
    default:
      return "baseline";
  }
}

std::vector<InstructionSet> availableInstructionSets() {
  std::vector<InstructionSet> sets{InstructionSet::kBaseline};
#ifdef BRASH_ICE_X86_KERNELS
  if (__builtin_cpu_supports("avx2")) sets.push_back(InstructionSet::kAvx2);
  // The flags in CMakeLists.txt.
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw")) {
    sets.push_back(InstructionSet::kAvx512);
  }
#endif
  return sets;
}

InstructionSet chosenInstructionSet() {
  const std::vector<InstructionSet> sets = availableInstructionSets();
  if (const char* wanted = std::getenv("BRASH_ICE_INSTRUCTION_SET")) {
    for (const InstructionSet set : sets) {
      if (std::strcmp(wanted, nameOf(set)) == 0) return set;
    }
  }
  return sets.back();
}

}  // namespace brash_ice_rig
