#include "brash_ice_rig/sph/sph_kernels.h"

namespace brash_ice_rig {

extern const SphKernels kSphKernels_baseline;
#ifdef BRASH_ICE_X86_KERNELS
extern const SphKernels kSphKernels_avx2, kSphKernels_avx512;
#endif

const SphKernels& sphKernels([[maybe_unused]] InstructionSet set) {
#ifdef BRASH_ICE_X86_KERNELS
  if (set == InstructionSet::kAvx512) return kSphKernels_avx512;
  if (set == InstructionSet::kAvx2) return kSphKernels_avx2;
#endif
  return kSphKernels_baseline;
}

}  // namespace brash_ice_rig
