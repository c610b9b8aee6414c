// What the kernels of direct volume rendering ask of a machine, for one sample: a thread of a device, or a
// host without vectors. dvr_lanes.h has the same for several samples side by side, with the same bits.
#pragma once

#include <cmath>
#include <cstdint>

#include "formats/hd.h"

namespace voxkit::render {

struct OneLane {
  using Real = float;
  using Int = int32_t;
  using Mask = bool;  ///< whether a condition holds in a lane

  VOX_HD_HOT static float all(float x) { return x; }
  VOX_HD_HOT static int32_t all(int32_t x) { return x; }
  /// These two return b if a is not a number.
  VOX_HD_HOT static float least(float a, float b) { return a < b ? a : b; }
  VOX_HD_HOT static float greatest(float a, float b) { return a > b ? a : b; }
  VOX_HD_HOT static float root(float x) { return std::sqrt(x); }
  VOX_HD_HOT static float to_float(int32_t x) { return static_cast<float>(x); }
  /// Towards zero; |x| < 2^31.
  VOX_HD_HOT static int32_t to_int(float x) { return static_cast<int32_t>(x); }
  VOX_HD_HOT static float bits_as_float(int32_t x) { return __builtin_bit_cast(float, x); }
  VOX_HD_HOT static int32_t float_as_bits(float x) { return __builtin_bit_cast(int32_t, x); }
};

}  // namespace voxkit::render
