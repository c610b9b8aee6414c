// From numbers of colours to pixels: a part of the colours as an image, along a curve that fills it
// (section 4.1 of the paper; FORMAT.md, section 4.6).
#pragma once

#include <cstdint>

#include "formats/hd.h"
#include "libcolor/params.h"

namespace voxkit::color {

inline constexpr int image_log2 = 10;
inline constexpr uint32_t image_side = 1 << image_log2;  ///< pixels: a part fills the image

struct Pixel {
  uint32_t x = 0, y = 0;
  friend bool operator==(const Pixel&, const Pixel&) = default;
};

/// Where colour `index` of a part is, below 2^20. Runs of 4^k colours from a multiple of that on are squares.
VOX_HD constexpr Pixel curve_pixel(ImageCurve curve, uint32_t index) {
  Pixel p;
  for (int level = 0; level < image_log2; ++level) {
    const uint32_t side = 1u << level, quarter = index >> 2 * level & 3;
    if (curve == ImageCurve::morton) {
      p.x |= (quarter & 1) << level;
      p.y |= (quarter >> 1) << level;
      continue;
    }
    switch (quarter) {
      case 0:
        p = {p.y, p.x};
        break;
      case 1:
        p.y += side;
        break;
      case 2:
        p = {p.x + side, p.y + side};
        break;
      default:
        p = {2 * side - 1 - p.y, side - 1 - p.x};
        break;
    }
  }
  return p;
}

}  // namespace voxkit::color
