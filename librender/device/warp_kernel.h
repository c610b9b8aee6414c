// The kernel of direct volume rendering on a device: a warp draws as many neighbouring pixels as it has
// threads. The tests run it on the host, lane by lane.
#pragma once

#include "librender/device/warp_bricks.h"
#include "librender/dvr/dense_sampler.h"

namespace voxkit::render {

constexpr int warps_a_block = 4;

/// What the pixels from `left` to `right` and from `top` to `bottom` of CastParams become, row by row.
struct WarpPicture {
  Pixel* pixels;
  PixelDetail* details;
  uint32_t* decoded;  ///< bricks, by warp
};
/// Warps that a picture needs.
VOX_HD_HOT int64_t warps_across(const CastParams& cast, int width) {
  return (cast.right - cast.left + width - 1) / width;
}
VOX_HD_HOT int64_t warps_of(const CastParams& cast, int width, int height) {
  return warps_across(cast, width) * ((cast.bottom - cast.top + height - 1) / height);
}

/// The work of a warp.
template <class Lanes, DvrGradient kind, class Sampler>
VOX_HD_HOT void draw_warp(const DvrParams& params, Sampler& sampler, int64_t warp,
                          const WarpPicture& picture) {
  const CastParams& cast = params.cast;
  const int64_t across = warps_across(cast, Lanes::width);
  const int x = cast.left + static_cast<int>(warp % across) * Lanes::width,
            y = cast.top + static_cast<int>(warp / across) * Lanes::height;
  DvrPixels<Lanes> found;
  march<Lanes, Sampler, kind>(params, sampler, x, y, found);
  for (int i = 0; i < Lanes::held; ++i) {
    const int lane = Lanes::first() + i, px = x + lane % Lanes::width, py = y + lane / Lanes::width;
    if (px >= cast.right || py >= cast.bottom) continue;
    const int64_t at = int64_t{py - cast.top} * (cast.right - cast.left) + (px - cast.left);
    finish_pixel(params, found, i, px, py, true, picture.pixels[at], picture.details[at]);
    if (lane == 0) picture.decoded[warp] = sampler.decoded();
  }
}

/// An uncompressed volume on the device.
template <class T>
struct WarpDense {
  const std::byte* voxels;
  int64_t dims[3];
  template <class Lanes>
  VOX_HD_HOT auto sampler(WarpCache&) const {
    return DenseSampler<T>(voxels, dims);
  }
};
/// A VQ file there, checked.
template <class Pools>
struct WarpVq {
  vq::View view;
  Pools pools;
  CodeValues values;
  int64_t dims[3];
  template <class Lanes>
  VOX_HD_HOT auto sampler(WarpCache& cache) const {
    return WarpBricks<Lanes, Pools>(view, pools, values, dims, cache);
  }
};

}  // namespace voxkit::render
