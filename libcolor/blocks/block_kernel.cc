#include "libcolor/blocks/block_kernel.h"

#include "formats/cpu.h"

namespace voxkit::color {
namespace portable {

#define VOXKIT_CODE
#include "libcolor/blocks/block_kernel_body.h"
#undef VOXKIT_CODE
#undef VOXKIT_INLINE

}  // namespace portable

#ifdef VOXKIT_AVX2
namespace avx2 {

#define VOXKIT_CODE VOXKIT_AVX2_CODE
#include "libcolor/blocks/block_kernel_body.h"
#undef VOXKIT_CODE
#undef VOXKIT_INLINE

}  // namespace avx2
#endif

const BlockKernels& block_kernels(bool native) {
  static const BlockKernels any{portable::extent_of, portable::distances_of, portable::nearest_of};
#ifdef VOXKIT_AVX2
  static const BlockKernels own{avx2::extent_of, avx2::distances_of, avx2::nearest_of};
  if (native && has_avx2()) return own;
#endif
  (void)native;
  return any;
}

}  // namespace voxkit::color
