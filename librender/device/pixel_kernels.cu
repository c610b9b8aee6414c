// The kernels of casting that GPUs have: one for each view.
#include "librender/cast/dag_grid.h"
#include "librender/device/cuda_run.h"
#include "librender/device/pixel_kernel.h"

namespace voxkit::render {

VOXKIT_CUDA_KERNEL(PixelKernel<DenseView>);
VOXKIT_CUDA_KERNEL(PixelKernel<BaselineView>);
VOXKIT_CUDA_KERNEL(PixelKernel<SvmmView<svmm::FlatPools, Search::path>>);
VOXKIT_CUDA_KERNEL(PixelKernel<SvmmView<svmm::FlatPools, Search::restart>>);
VOXKIT_CUDA_KERNEL(PixelKernel<DagCastView<Search::path>>);
VOXKIT_CUDA_KERNEL(PixelKernel<DagCastView<Search::restart>>);

}  // namespace voxkit::render
