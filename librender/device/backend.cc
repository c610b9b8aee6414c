#include "librender/device/backend.h"

#include <cstring>

#include "formats/copy.h"
#include "librender/device/cuda_backend.h"

namespace voxkit::render {
namespace {

/// Bytes between two looks at whether somebody wants us to stop.
constexpr size_t piece = size_t{16} << 20;

class HostMemory final : public DeviceMemory {
 public:
  explicit HostMemory(std::unique_ptr<Buffer> buffer)
      : DeviceMemory(buffer->data()), buffer_(std::move(buffer)) {}

 private:
  std::unique_ptr<Buffer> buffer_;
};

/// Kernels run on this machine, and have copies of what they read, as on any other.
class Threads final : public Backend {
 public:
  Threads() : Backend(BackendKind::threads) {}

 private:
  Result<std::unique_ptr<DeviceMemory>> allocate_bytes(uint64_t bytes, const std::string& what,
                                                       Context& ctx) const override {
    VOX_TRY(auto buffer, Buffer::allocate(bytes, what, ctx));
    return std::make_unique<HostMemory>(std::move(buffer));
  }
  Status copy_in(std::byte* to, std::span<const std::byte> from) const override {
    std::memcpy(to, from.data(), from.size());
    return {};
  }
  Status copy_out(std::span<std::byte> to, const std::byte* from) const override {
    std::memcpy(to.data(), from, to.size());
    return {};
  }
};

/// Whether `bytes` of elements from `first` on are within an array.
bool is_within(uint64_t size, uint64_t first, size_t bytes, size_t element) {
  return first <= size && bytes / element <= size - first;
}
tl::unexpected<Error> beyond() {
  return fail(ErrorCode::internal, {}, "copying beyond an array of a device");
}

}  // namespace

Result<std::shared_ptr<const Backend>> Backend::open(BackendKind kind) {
  if (kind == BackendKind::cuda) {
#ifdef VOXKIT_CUDA
    return open_cuda();
#else
    return fail(ErrorCode::device, {},
                "--device cuda: this build has no CUDA: nvcc was not found when it was configured");
#endif
  }
  return std::make_shared<const Threads>();
}

tl::unexpected<Error> not_on_devices(const char* name) {
  return fail(ErrorCode::internal, {}, std::string(name) + ": this kernel was not compiled for GPUs");
}

Status Backend::write(void* array, uint64_t size, uint64_t first, std::span<const std::byte> from,
                      size_t element) const {
  if (!is_within(size, first, from.size(), element)) return beyond();
  std::byte* const to = static_cast<std::byte*>(array) + first * element;
  for (size_t at = 0; at < from.size(); at += piece) {
    VOX_CHECK(check_interrupt());
    VOX_CHECK(copy_in(to + at, from.subspan(at, std::min(piece, from.size() - at))));
  }
  return {};
}

Status Backend::read(const void* array, uint64_t size, uint64_t first, std::span<std::byte> to,
                     size_t element) const {
  if (!is_within(size, first, to.size(), element)) return beyond();
  if (to.empty()) return {};
  return copy_out(to, static_cast<const std::byte*>(array) + first * element);
}

}  // namespace voxkit::render
