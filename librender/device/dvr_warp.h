// A warp of a GPU as the lanes of a packet: every thread has one. For nvcc; dvr_lanes.h has what the same
// code runs with on a host.
#pragma once

#include "librender/dvr/dvr_lane.h"

namespace voxkit::render {

/// Rays through 8 x 4 neighbouring pixels. All 32 threads call all of it together. Threads are numbered along
/// x.
struct Warp : OneLane {
  static constexpr int width = 8, height = 4, count = 32;
  static constexpr int held = 1;  ///< lanes of this thread, `first()` being the first one
  static constexpr unsigned everyone = ~0u;
  __device__ static int first() { return static_cast<int>(threadIdx.x % count); }

  template <class Value>
  __device__ static Value load(const Value (&values)[1]) {
    return values[0];
  }
  template <class Value>
  __device__ static Value get(const Value& x, int) {
    return x;
  }
  template <class Value>
  __device__ static Value broadcast(Value x, int lane) {
    return __shfl_sync(everyone, x, lane);
  }
  __device__ static void sync() { __syncwarp(); }
  __device__ static uint32_t bits(bool condition) { return __ballot_sync(everyone, condition); }
  __device__ static int32_t least_lane(int32_t x) {
    for (int bit = 1; bit < count; bit *= 2) {
      const int32_t other = __shfl_xor_sync(everyone, x, bit);
      x = other < x ? other : x;
    }
    return x;
  }
  template <class Value>
  __device__ static Value beside(Value x) {
    return static_cast<Value>(__shfl_xor_sync(everyone, x, 1));
  }
  template <class Value>
  __device__ static Value below(Value x) {
    return static_cast<Value>(__shfl_xor_sync(everyone, x, width));
  }

  template <class T>
  __device__ static void gather_pair(const T* base, int32_t at, bool wanted, float& a, float& b) {
    a = wanted ? static_cast<float>(base[at]) : 0;
    b = wanted ? static_cast<float>(base[at + 1]) : 0;
  }
  __device__ static float gather(const float* base, int32_t at, bool wanted) { return wanted ? base[at] : 0; }
  __device__ static int32_t gather(const uint8_t* base, int32_t at, bool wanted) {
    return wanted ? base[at] : 0;
  }
};

}  // namespace voxkit::render
