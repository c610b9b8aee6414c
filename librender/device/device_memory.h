// Memory and clocks of a GPU, for nvcc.
#pragma once

#include <cuda_runtime.h>

#include <string>
#include <utility>

#include "formats/result.h"

namespace voxkit::render {

inline Status check(cudaError_t error, const char* what) {
  if (error == cudaSuccess) return {};
  if (error == cudaErrorMemoryAllocation)
    return fail(ErrorCode::limit, {}, std::string(what) + ": the GPU's memory does not suffice");
  return fail(ErrorCode::device, {}, std::string(what) + ": " + cudaGetErrorString(error));
}

/// Memory on the device.
template <class T>
class DeviceArray {
 public:
  DeviceArray() = default;
  static Result<DeviceArray> allocate(uint64_t count) {
    DeviceArray array;
    VOX_CHECK(check(cudaMalloc(&array.data_, count * sizeof(T)), "allocating"));
    return array;
  }
  static Result<DeviceArray> copy_of(const T& value) {
    VOX_TRY(DeviceArray array, allocate(1));
    VOX_CHECK(check(cudaMemcpy(array.data_, &value, sizeof(T), cudaMemcpyHostToDevice), "uploading"));
    return array;
  }
  DeviceArray(DeviceArray&& other) noexcept : data_(std::exchange(other.data_, nullptr)) {}
  DeviceArray& operator=(DeviceArray&& other) noexcept {
    std::swap(data_, other.data_);
    return *this;
  }
  ~DeviceArray() { cudaFree(data_); }
  T* data() const { return data_; }

 private:
  T* data_ = nullptr;
};

/// Start and end of a kernel on the device's own clock.
class Events {
 public:
  static Result<Events> create() {
    Events events;
    for (cudaEvent_t& event : events.events_) VOX_CHECK(check(cudaEventCreate(&event), "timing"));
    return events;
  }
  Events(Events&& other) noexcept
      : events_{std::exchange(other.events_[0], nullptr), std::exchange(other.events_[1], nullptr)} {}
  ~Events() {
    for (cudaEvent_t event : events_)
      if (event) cudaEventDestroy(event);
  }
  Status record(int which) const { return check(cudaEventRecord(events_[which]), "timing"); }
  Result<double> seconds() const {
    float ms = 0;
    VOX_CHECK(check(cudaEventSynchronize(events_[1]), "casting"));
    VOX_CHECK(check(cudaEventElapsedTime(&ms, events_[0], events_[1]), "timing"));
    return static_cast<double>(ms) / 1000;
  }

 private:
  Events() = default;
  cudaEvent_t events_[2] = {};
};

}  // namespace voxkit::render
