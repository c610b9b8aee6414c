// The kernel of casting: one index a pixel, block by block, so that threads side by side have neighbouring
// rays.
#pragma once

#include "librender/cast/cast_kernel.h"

namespace voxkit::render {

/// `pixels`, `details` and `costs` have width * height elements.
template <class View>
struct PixelKernel {
  static constexpr bool on_devices = true;
  static constexpr int edge = 8;  ///< of a block of pixels
  CastParams params;
  View view;
  Pixel* pixels;
  PixelDetail* details;
  PixelCost* costs;

  VOX_HD int64_t across() const { return (params.width + edge - 1) / edge; }
  /// Indices, those of the last blocks past the picture's edge included.
  VOX_HD int64_t count() const { return across() * ((params.height + edge - 1) / edge) * (edge * edge); }
  VOX_HD void operator()(int64_t index) const {
    const int64_t block = index / (edge * edge);
    const int within = static_cast<int>(index % (edge * edge)),
              x = static_cast<int>(block % across()) * edge + within % edge,
              y = static_cast<int>(block / across()) * edge + within / edge;
    if (x >= params.width || y >= params.height) return;
    auto cursor = view.cursor();
    const bool looked_at = x >= params.left && x < params.right && y >= params.top && y < params.bottom;
    Pixel pixel;
    PixelDetail detail;
    if (looked_at) cast_ray(params, cursor, x, y, pixel, detail);
    const int64_t i = int64_t{y} * params.width + x;
    pixels[i] = pixel;
    details[i] = detail;
    costs[i] = {cursor.blocks(), cursor.bytes()};
  }
};

}  // namespace voxkit::render
