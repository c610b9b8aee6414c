// Kernels over the threads of a GPU, for nvcc: a file of kernels lists those that it compiles, with
// VOXKIT_CUDA_KERNEL and VOXKIT_CUDA_GROUPS.
#pragma once

#include <cuda_runtime.h>

#include "librender/device/backend.h"
#include "librender/device/dvr_warp.h"

namespace voxkit::render {

/// The error of a call, which is then forgotten.
Status cuda_check(cudaError_t error, const char* what);
/// Blocks of `each` indices; ErrorCode::limit where there are more than a GPU takes.
Result<unsigned> cuda_blocks(const char* name, int64_t count, int64_t each);

/// The time that a kernel takes on the device's own clock.
class CudaTimer {
 public:
  CudaTimer() = default;
  CudaTimer(const CudaTimer&) = delete;
  CudaTimer& operator=(const CudaTimer&) = delete;
  ~CudaTimer();
  Status start();
  /// Seconds; or the error of what was launched since.
  Result<double> stop(const char* name);

 private:
  cudaEvent_t events_[2] = {};
};

/// Threads of a block, at most: rays end at different times, and all of a block wait for the last one.
inline constexpr int most_block_threads = 256;
/// Of memory that a block shares, at most, on every GPU.
inline constexpr size_t most_block_memory = 48 << 10;

template <class Kernel>
__global__ void cuda_kernel(const __grid_constant__ Kernel kernel, int64_t count) {
  const int64_t i = int64_t{blockIdx.x} * blockDim.x + threadIdx.x;
  if (i < count) kernel(i);
}

template <class Kernel>
__global__ void cuda_groups(const __grid_constant__ Kernel kernel, int64_t count) {
  extern __shared__ __align__(16) unsigned char memory[];
  auto* const shared = reinterpret_cast<typename Kernel::Shared*>(memory);
  const unsigned within = threadIdx.x / Warp::count;
  const int64_t group = int64_t{blockIdx.x} * (blockDim.x / Warp::count) + within;
  if (group < count) kernel.template operator()<Warp>(group, shared[within]);  // all of a warp, or none
}

template <class Kernel>
Result<double> run_on_cuda(const char* name, int64_t count, const Kernel& kernel) {
  cudaFuncAttributes attributes;  // to ask for them loads the kernel, which is not to be timed
  VOX_CHECK(cuda_check(cudaFuncGetAttributes(&attributes, cuda_kernel<Kernel>), name));
  int least_blocks = 0, threads = 0;
  VOX_CHECK(cuda_check(
      cudaOccupancyMaxPotentialBlockSize(&least_blocks, &threads, cuda_kernel<Kernel>, 0, most_block_threads),
      name));
  VOX_TRY(const unsigned blocks, cuda_blocks(name, count, threads));
  CudaTimer timer;
  VOX_CHECK(timer.start());
  cuda_kernel<<<blocks, static_cast<unsigned>(threads)>>>(kernel, count);
  return timer.stop(name);
}

template <class Kernel>
Result<double> run_groups_on_cuda(const char* name, const Kernel& kernel) {
  constexpr size_t shared = sizeof(typename Kernel::Shared);
  constexpr auto most = static_cast<int>(most_block_memory / shared < most_block_threads / Warp::count
                                             ? most_block_memory / shared
                                             : most_block_threads / Warp::count);
  static_assert(most >= 1 && alignof(typename Kernel::Shared) <= 16);
  const int64_t count = kernel.template groups<Warp>();
  cudaFuncAttributes attributes;
  VOX_CHECK(cuda_check(cudaFuncGetAttributes(&attributes, cuda_groups<Kernel>), name));
  int least_blocks = 0, threads = 0;
  VOX_CHECK(
      cuda_check(cudaOccupancyMaxPotentialBlockSizeVariableSMem(
                     &least_blocks, &threads, cuda_groups<Kernel>,
                     [](int n) { return static_cast<size_t>(n) / Warp::count * shared; }, most * Warp::count),
                 name));
  const int warps = threads / Warp::count > 1 ? threads / Warp::count : 1;
  VOX_TRY(const unsigned blocks, cuda_blocks(name, count, warps));
  CudaTimer timer;
  VOX_CHECK(timer.start());
  cuda_groups<<<blocks, static_cast<unsigned>(warps * Warp::count), static_cast<size_t>(warps) * shared>>>(
      kernel, count);
  return timer.stop(name);
}

}  // namespace voxkit::render

#define VOXKIT_CUDA_KERNEL(...) template Result<double> run_on_cuda(const char*, int64_t, const __VA_ARGS__&)
#define VOXKIT_CUDA_GROUPS(...) template Result<double> run_groups_on_cuda(const char*, const __VA_ARGS__&)
