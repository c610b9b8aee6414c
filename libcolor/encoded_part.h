// What becomes of a part of the colours.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "libcolor/surface/surface.h"

namespace voxkit::color {

struct EncodedPart {
  std::vector<std::byte> bytes;
  uint64_t blocks = 0;
  uint64_t squared_error = 0;  ///< sum of squared RGB distances of decoded colours
  uint32_t most_squared =
      0;  ///< the greatest; of blocks with a threshold in CIELAB that there, times lab_scale^2

  /// Counts what a colour has become.
  void add_error(Rgb color, Rgb decoded) {
    const int r = color.r - decoded.r, g = color.g - decoded.g, b = color.b - decoded.b;
    const auto squared = static_cast<uint32_t>(r * r + g * g + b * b);
    squared_error += squared;
    most_squared = std::max(most_squared, squared);
  }
};

}  // namespace voxkit::color
