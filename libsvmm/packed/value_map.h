// From voxels to the unsigned integers that pages hold, and back.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "formats/result.h"
#include "formats/volume.h"

namespace voxkit::svmm {

/// How a voxel becomes a code. Numbers are part of FORMAT.md.
enum class CodeKind : uint8_t {
  integers = 1,  ///< BITMAP, DENSITY8, DENSITY16: the stored value
  ordered = 2,   ///< FLOAT32: its bits, such that codes ascend as floats do; -0 before 0, NaN at both ends
  steps = 3,     ///< FLOAT32: 0 NaN, 1 and 2 the infinities, c >= 3: lo + (c - 3) step, rounded to a float
  colors = 4,    ///< RGBA32, RGB24: a mask and channels (color_page.h)
  indexed = 5,   ///< these: 0 void, else the number of a color, counted from 1, in bytes
};

struct ValueMap {
  CodeKind kind = CodeKind::integers;
  double lo = 0, step = 1;                           ///< of steps
  std::shared_ptr<const std::vector<Voxel>> colors;  ///< of indexed ones

  /// Codes of `voxels`, `count` of them, of a format that goes with the kind: of BITMAP and DENSITY8 bytes,
  /// of DENSITY16 16 bits, of FLOAT32 32 bits.
  static uint32_t ordered(float value);
  static float from_ordered(uint32_t code);
  uint32_t code(float value) const;
  float value(uint32_t code) const;

  /// Floats within `max_error` of values from `lo` to `hi`: in steps of nearly twice that, or, where floats
  /// are too coarse, or too many, for steps, ordered bits. `max_error` 0: ordered.
  static ValueMap for_floats(ValueRange range, double max_error);
  /// The same steps, moved down by less than one, so that one of them is 0; where 0 is not below them.
  ValueMap through_zero() const;
  /// A bound that is not much above the least one for which there are steps.
  static double least_error(ValueRange range);
};

/// Bytes of a code: 1, 2 or 4.
int code_bytes(VoxelFormat format);

}  // namespace voxkit::svmm
