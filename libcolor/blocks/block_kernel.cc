#include "libcolor/blocks/block_kernel.h"

#include "formats/cpu.h"

namespace voxkit::color {
namespace portable {

#define VOXKIT_CODE
#define VOXKIT_ANY(mask) any_of(reinterpret_cast<Longs>(mask))
using Longs = int64_t __attribute__((vector_size(32)));
static inline bool any_of(Longs mask) {
  return (mask[0] | mask[1] | mask[2] | mask[3]) != 0;
}
#include "libcolor/blocks/block_kernel_body.h"
#undef VOXKIT_CODE
#undef VOXKIT_ANY
#undef VOXKIT_INLINE

}  // namespace portable

#ifdef VOXKIT_AVX2
namespace avx2 {

#define VOXKIT_CODE VOXKIT_AVX2_CODE
#define VOXKIT_ANY(mask) (__builtin_ia32_movmskps256(reinterpret_cast<Floats>(mask)) != 0)
#include "libcolor/blocks/block_kernel_body.h"
#undef VOXKIT_CODE
#undef VOXKIT_ANY
#undef VOXKIT_INLINE

}  // namespace avx2
#endif

const BlockKernels& block_kernels(bool native) {
  static const BlockKernels any{portable::extent_of, portable::distances_of, portable::within_of,
                                portable::line_of, portable::nearest_of};
#ifdef VOXKIT_AVX2
  static const BlockKernels own{avx2::extent_of, avx2::distances_of, avx2::within_of, avx2::line_of,
                                avx2::nearest_of};
  if (native && has_avx2()) return own;
#endif
  (void)native;
  return any;
}

}  // namespace voxkit::color
