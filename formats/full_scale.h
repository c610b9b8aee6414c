// The peak of "peak signal to noise": how large an error could be at most, given what a volume holds.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

#include "formats/volume.h"

namespace voxkit {

/// The peak of a volume: 255 for DENSITY8 and colours, 1 for BITMAP. DENSITY16: 2^b - 1 with the b bits (at
/// least 1) that `range`, extended to the sample value 0, needs: scanners store 12 bits in 16; of integers of
/// more than 16 bits those that the extent of the range alone needs. FLOAT32: the
/// extent of the range, 1 where that is 0. `range`: stored values of the volume (unused for the other
/// formats).
inline double full_scale(const VolumeInfo& info, const ValueRange& range) {
  switch (info.format) {
    case VoxelFormat::bitmap:
      return 1;
    case VoxelFormat::density16: {
      const double zero = info.has_wide_base() ? range.lo : static_cast<double>(info.bias());
      const auto extent =
          static_cast<uint64_t>(std::min(std::max(range.hi, zero) - std::min(range.lo, zero), 0x1p52));
      return static_cast<double>((uint64_t{1} << std::max(1, static_cast<int>(std::bit_width(extent)))) - 1);
    }
    case VoxelFormat::float32:
      return range.hi > range.lo ? range.hi - range.lo : 1;
    default:
      return 255;
  }
}

}  // namespace voxkit
