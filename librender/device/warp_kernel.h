// The kernel of direct volume rendering on a device: a warp draws as many neighbouring pixels as it has
// threads; on a host, a vector as many as it has lanes.
#pragma once

#include "librender/device/warp_bricks.h"
#include "librender/dvr/dense_sampler.h"

namespace voxkit::render {

/// Where the pixels from row `top` to row `bottom` of CastParams go, each row being as wide as the picture.
struct WarpPicture {
  Pixel* pixels;
  PixelDetail* details;
  PixelCost* costs;  ///< blocks: bricks that a group decoded, at its first pixel
};
/// Groups that a picture needs.
VOX_HD_HOT int64_t warps_across(const CastParams& cast, int width) {
  return (cast.right - cast.left + width - 1) / width;
}
VOX_HD_HOT int64_t warps_of(const CastParams& cast, int width, int height) {
  const int64_t across = warps_across(cast, width), down = (cast.bottom - cast.top + height - 1) / height;
  return across > 0 && down > 0 ? across * down : 0;
}

/// The work of a group.
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
    const int64_t at = int64_t{py - cast.top} * cast.width + px;
    finish_pixel(params, found, i, px, py, true, picture.pixels[at], picture.details[at]);
    picture.costs[at] = {lane == 0 ? sampler.decoded() : 0, 0};
  }
}

/// An uncompressed volume on the device.
template <class T>
struct WarpDense {
  struct Shared {};  ///< nothing is
  const std::byte* voxels;
  int64_t dims[3];
  template <class Lanes>
  VOX_HD_HOT auto sampler(Shared&) const {
    return DenseSampler<T>(voxels, dims);
  }
};
/// A VQ file there, checked.
template <class Pools>
struct WarpVq {
  using Shared = WarpCache;
  vq::View view;
  Pools pools;
  CodeValues values;
  int64_t dims[3];
  template <class Lanes>
  VOX_HD_HOT auto sampler(Shared& cache) const {
    return WarpBricks<Lanes, Pools>(view, pools, values, dims, cache);
  }
};

/// The kernel.
template <DvrGradient kind, class View>
struct WarpKernel {
  static constexpr bool on_devices = true;
  using Shared = typename View::Shared;
  DvrParams params;
  View view;
  WarpPicture picture;

  template <class Lanes>
  VOX_HD int64_t groups() const {
    return warps_of(params.cast, Lanes::width, Lanes::height);
  }
  template <class Lanes>
  VOX_HD void operator()(int64_t group, Shared& shared) const {
    auto sampler = view.template sampler<Lanes>(shared);
    draw_warp<Lanes, kind>(params, sampler, group, picture);
  }
};

}  // namespace voxkit::render
