#include "librender/device/cuda_backend.h"

#include <string>

#include "librender/device/cuda_run.h"

namespace voxkit::render {
namespace {

constexpr int least_capability = 75;  ///< that kernels are compiled for: ten times major, and minor

std::string capability(int number) {
  return std::to_string(number / 10) + "." + std::to_string(number % 10);
}

class CudaMemory final : public DeviceMemory {
 public:
  explicit CudaMemory(void* data) : DeviceMemory(static_cast<std::byte*>(data)) {}
  ~CudaMemory() override { cudaFree(data()); }
};

class Cuda final : public Backend {
 public:
  Cuda() : Backend(BackendKind::cuda) {}

 private:
  Result<std::unique_ptr<DeviceMemory>> allocate_bytes(uint64_t bytes, const std::string& what,
                                                       Context&) const override {
    void* data = nullptr;
    const cudaError_t error = cudaMalloc(&data, bytes);
    if (error == cudaErrorMemoryAllocation) {
      cudaGetLastError();
      size_t free = 0, all = 0;
      cudaMemGetInfo(&free, &all);
      return fail(ErrorCode::limit, {},
                  what + " needs " + std::to_string(bytes) + " bytes: the GPU's memory does not suffice: " +
                      std::to_string(free) + " of " + std::to_string(all) + " are free");
    }
    VOX_CHECK(cuda_check(error, "allocating"));
    return std::make_unique<CudaMemory>(data);
  }
  Status copy_in(std::byte* to, std::span<const std::byte> from) const override {
    return cuda_check(cudaMemcpy(to, from.data(), from.size(), cudaMemcpyHostToDevice), "uploading");
  }
  Status copy_out(std::span<std::byte> to, const std::byte* from) const override {
    return cuda_check(cudaMemcpy(to.data(), from, to.size(), cudaMemcpyDeviceToHost), "downloading");
  }
};

}  // namespace

Status cuda_check(cudaError_t error, const char* what) {
  if (error == cudaSuccess) return {};
  cudaGetLastError();  // it is reported here: what comes next begins anew
  return fail(ErrorCode::device, {}, std::string(what) + ": " + cudaGetErrorString(error));
}

Result<std::shared_ptr<const Backend>> open_cuda() {
  int count = 0;
  const cudaError_t error = cudaGetDeviceCount(&count);
  if (error != cudaSuccess) {
    cudaGetLastError();
    return fail(ErrorCode::device, {},
                std::string("--device cuda: no GPU can be used: ") + cudaGetErrorString(error) +
                    ": expected a CUDA device and its driver");
  }
  if (count == 0)
    return fail(ErrorCode::device, {}, "--device cuda: there is no GPU: expected a CUDA device");
  int major = 0, minor = 0;
  VOX_CHECK(
      cuda_check(cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, 0), "--device cuda"));
  VOX_CHECK(
      cuda_check(cudaDeviceGetAttribute(&minor, cudaDevAttrComputeCapabilityMinor, 0), "--device cuda"));
  if (10 * major + minor < least_capability)
    return fail(ErrorCode::device, {},
                "--device cuda: the GPU is of compute capability " + capability(10 * major + minor) +
                    ": expected " + capability(least_capability) + " or more");
  return std::make_shared<const Cuda>();
}

CudaTimer::~CudaTimer() {
  for (cudaEvent_t event : events_)
    if (event) cudaEventDestroy(event);
}
Status CudaTimer::start() {
  for (cudaEvent_t& event : events_) VOX_CHECK(cuda_check(cudaEventCreate(&event), "timing"));
  return cuda_check(cudaEventRecord(events_[0]), "timing");
}
Result<double> CudaTimer::stop(const char* name) {
  VOX_CHECK(cuda_check(cudaGetLastError(), name));
  VOX_CHECK(cuda_check(cudaEventRecord(events_[1]), "timing"));
  VOX_CHECK(cuda_check(cudaEventSynchronize(events_[1]), name));
  float ms = 0;
  VOX_CHECK(cuda_check(cudaEventElapsedTime(&ms, events_[0], events_[1]), "timing"));
  return static_cast<double>(ms) / 1000;
}

Result<unsigned> cuda_blocks(const char* name, int64_t count, int64_t each) {
  const int64_t blocks = (count + each - 1) / each;
  if (blocks > INT32_MAX)
    return fail(ErrorCode::limit, {}, std::string(name) + ": too many pixels for one run of a GPU");
  return static_cast<unsigned>(blocks);
}

}  // namespace voxkit::render
