// The kernels of direct volume rendering that GPUs have: one for each view, and each kind of gradients.
#include "librender/device/cuda_run.h"
#include "librender/device/vq_flat_pools.h"
#include "librender/device/warp_kernel.h"

namespace voxkit::render {

#define VOXKIT_CUDA_GRADIENTS(...)                                    \
  VOXKIT_CUDA_GROUPS(WarpKernel<DvrGradient::none, __VA_ARGS__>);     \
  VOXKIT_CUDA_GROUPS(WarpKernel<DvrGradient::analytic, __VA_ARGS__>); \
  VOXKIT_CUDA_GROUPS(WarpKernel<DvrGradient::neighbour, __VA_ARGS__>)

VOXKIT_CUDA_GRADIENTS(WarpDense<uint8_t>);
VOXKIT_CUDA_GRADIENTS(WarpDense<uint16_t>);
VOXKIT_CUDA_GRADIENTS(WarpDense<float>);
VOXKIT_CUDA_GRADIENTS(WarpVq<FlatVqPools>);

}  // namespace voxkit::render
