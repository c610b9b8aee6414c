// Where kernels run: on the threads of this machine, or on a GPU by CUDA. A kernel is a body of an index;
// what is run, and what it reads, is the same on both.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <type_traits>

#include "formats/context.h"

namespace voxkit::render {

/// threads: those of the context that a kernel is run with. cuda: the first GPU.
enum class BackendKind { threads, cuda };

/// Memory that the kernels of a backend reach, until it goes.
class DeviceMemory {
 public:
  virtual ~DeviceMemory() = default;
  DeviceMemory(const DeviceMemory&) = delete;
  DeviceMemory& operator=(const DeviceMemory&) = delete;
  /// Aligned for anything; of use to kernels only.
  std::byte* data() const { return data_; }

 protected:
  explicit DeviceMemory(std::byte* data) : data_(data) {}

 private:
  std::byte* data_;
};

/// An array in such memory. Moves, does not copy.
template <class T>
class DeviceArray {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  DeviceArray() = default;
  DeviceArray(std::unique_ptr<DeviceMemory> memory, uint64_t size)
      : memory_(std::move(memory)), size_(size) {}
  T* data() const { return memory_ ? reinterpret_cast<T*>(memory_->data()) : nullptr; }
  uint64_t size() const { return size_; }

 private:
  std::unique_ptr<DeviceMemory> memory_;
  uint64_t size_ = 0;
};

/// Runs kernels, and has the memory that they read and write. What it does may be done by several threads;
/// what kernels write, by one at a time.
class Backend {
 public:
  /// ErrorCode::device says why there is none: no CUDA in this build, no driver, no GPU, or an old one.
  static Result<std::shared_ptr<const Backend>> open(BackendKind kind);
  virtual ~Backend() = default;
  BackendKind kind() const { return kind_; }

  /// An array of `count` elements that hold anything; it may be empty. What threads have counts against
  /// ctx.memory. ErrorCode::limit, naming `what` and the bytes, where memory does not suffice.
  template <class T>
  Result<DeviceArray<T>> allocate(uint64_t count, const std::string& what, Context& ctx) const {
    const uint64_t bytes = count > UINT64_MAX / sizeof(T) ? UINT64_MAX : count * sizeof(T);
    VOX_TRY(auto memory, allocate_bytes(std::max<uint64_t>(bytes, 1), what, ctx));
    return DeviceArray<T>(std::move(memory), count);
  }
  /// A copy of values.
  template <class T>
  Result<DeviceArray<T>> upload(std::span<const T> values, const std::string& what, Context& ctx) const {
    VOX_TRY(auto array, allocate<T>(values.size(), what, ctx));
    VOX_CHECK(fill(array, 0, values));
    return array;
  }
  /// Makes an array at least so large: it stays what it is where that suffices.
  template <class T>
  Status reserve(DeviceArray<T>& array, uint64_t count, const std::string& what, Context& ctx) const {
    if (array.data() != nullptr && array.size() >= count) return {};
    array = {};  // not both at once
    VOX_TRY(array, allocate<T>(count, what, ctx));
    return {};
  }
  /// Copies values to the elements from `first` on, piece by piece, so that a signal is heard.
  template <class T>
  Status fill(const DeviceArray<T>& to, uint64_t first, std::span<const T> from) const {
    return write(to.data(), to.size(), first, std::as_bytes(from), sizeof(T));
  }
  /// Copies the elements from `first` on.
  template <class T>
  Status download(const DeviceArray<T>& from, uint64_t first, std::span<T> to) const {
    return read(from.data(), from.size(), first, std::as_writable_bytes(to), sizeof(T));
  }

  /// Runs kernel(0) … kernel(count - 1), `void operator()(int64_t) const`, in any order and side by side.
  /// Returns the seconds that this took, without what is done once for a kernel. Kernels that GPUs run have a
  /// member `on_devices`, and are listed in a file of kernels, *.cu.
  template <class Kernel>  // backend_run.h
  Result<double> run(const char* name, int64_t count, const Kernel& kernel, Context& ctx) const;

  /// Runs a kernel whose indices are worked on by groups of lanes that have memory in common, each for its
  /// own: `void operator()<Lanes>(int64_t, Kernel::Shared&) const`, for `groups<Lanes>()` indices. A group is
  /// a warp of a GPU, or the lanes of a vector. `Shared` begins with anything.
  template <class Kernel>  // backend_run.h
  Result<double> run_groups(const char* name, const Kernel& kernel, Context& ctx) const;

 protected:
  explicit Backend(BackendKind kind) : kind_(kind) {}
  virtual Result<std::unique_ptr<DeviceMemory>> allocate_bytes(uint64_t bytes, const std::string& what,
                                                               Context& ctx) const = 0;
  virtual Status copy_in(std::byte* to, std::span<const std::byte> from) const = 0;
  virtual Status copy_out(std::span<std::byte> to, const std::byte* from) const = 0;

 private:
  Status write(void* array, uint64_t size, uint64_t first, std::span<const std::byte> from,
               size_t element) const;
  Status read(const void* array, uint64_t size, uint64_t first, std::span<std::byte> to,
              size_t element) const;
  BackendKind kind_;
};

/// What GPUs have of a kernel: cuda_run.h, where the kernel is listed.
template <class Kernel>
Result<double> run_on_cuda(const char* name, int64_t count, const Kernel& kernel);
template <class Kernel>
Result<double> run_groups_on_cuda(const char* name, const Kernel& kernel);
/// What is said of a kernel that they do not have.
tl::unexpected<Error> not_on_devices(const char* name);

}  // namespace voxkit::render
