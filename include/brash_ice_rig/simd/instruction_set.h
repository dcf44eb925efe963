#pragma once

#include <vector>

namespace brash_ice_rig {

/// For which machines the kernels are compiled, in rising order. kBaseline is what the compiler makes of them for every
/// machine of the architecture.
enum class InstructionSet { kBaseline, kAvx2, kAvx512 };

/// "baseline", "avx2" or "avx512".
const char* nameOf(InstructionSet set);

/// Those that this program holds and this machine can run, in rising order; kBaseline is always among them.
std::vector<InstructionSet> availableInstructionSets();

/// The widest available one, or the one that the environment variable BRASH_ICE_INSTRUCTION_SET names (for tests and
/// benchmarks; a name that is not available counts as not set). All give the same bits: the kernels keep the order of
/// each sum, use no fused multiply-add, and call no function of the C library.
InstructionSet chosenInstructionSet();

}  // namespace brash_ice_rig
