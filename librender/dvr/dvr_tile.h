// A tile of a picture on the host, for any sampler: packets of rays, compiled for two kinds of machine.
#pragma once

#include <functional>

#include "formats/cpu.h"
#include "librender/dvr/dvr_draw.h"
#include "librender/dvr/dvr_lanes.h"

namespace voxkit::render {

/// Pixels x0 <= x < x1, y0 <= y < y1.
struct DvrTile {
  int x0, y0, x1, y1;
};
/// What a tile cost.
struct DvrCounts {
  uint64_t hit = 0, bricks = 0, samples = 0, decoded = 0;
};

/// What a packet found becomes pixels.
template <class Lanes>
[[gnu::always_inline]] inline void keep(const DvrParams& params, const DvrPixels<Lanes>& found, int x, int y,
                                        Frame& frame, bool details, DvrCounts& count) {
  const CastParams& cast = params.cast;
  count.bricks += found.bricks;
  for (int i = 0; i < Lanes::count; ++i) {
    const int px = x + i % Lanes::width, py = y + i / Lanes::width;
    if (px >= cast.right || py >= cast.bottom) continue;
    const auto at = static_cast<size_t>(py) * static_cast<size_t>(cast.width) + static_cast<size_t>(px);
    PixelDetail detail;
    finish_pixel(params, found, i, px, py, details, frame.pixels[at], detail);
    count.hit += found.hit[i] != 0;
    count.samples += detail.cells;
    if (details) frame.details[at] = detail;
  }
}

template <class Lanes, DvrGradient kind, class Sampler>
[[gnu::always_inline]] inline void draw_tile(const DvrParams& params, Sampler& sampler, const DvrTile& tile,
                                             Frame& frame, bool details, DvrCounts& count) {
  for (int y = tile.y0; y < tile.y1; y += Lanes::height)
    for (int x = tile.x0; x < tile.x1; x += Lanes::width) {
      DvrPixels<Lanes> found;
      march<Lanes, Sampler, kind>(params, sampler, x, y, found);
      keep(params, found, x, y, frame, details, count);
    }
}

// The same code for two kinds of machine.
template <DvrGradient kind, class Sampler>
void draw_generic(const DvrParams& params, Sampler& sampler, const DvrTile& tile, Frame& frame, bool details,
                  DvrCounts& count) {
  draw_tile<PortableLanes, kind>(params, sampler, tile, frame, details, count);
}
#ifdef VOXKIT_AVX2
template <DvrGradient kind, class Sampler>
VOXKIT_AVX2_CODE void draw_avx2(const DvrParams& params, Sampler& sampler, const DvrTile& tile, Frame& frame,
                                bool details, DvrCounts& count) {
  draw_tile<Avx2Lanes, kind>(params, sampler, tile, frame, details, count);
}
#endif

template <class Sampler>
using DvrDraw = void (*)(const DvrParams&, Sampler&, const DvrTile&, Frame&, bool, DvrCounts&);

template <class Sampler, DvrGradient kind>
DvrDraw<Sampler> chosen(bool native) {
#ifdef VOXKIT_AVX2
  if (native && has_avx2()) return draw_avx2<kind, Sampler>;
#else
  (void)native;
#endif
  return draw_generic<kind, Sampler>;
}
template <class Sampler>
DvrDraw<Sampler> chosen(const DvrJob& job) {
  switch (job.gradient) {
    case DvrGradient::none:
      return chosen<Sampler, DvrGradient::none>(job.native);
    case DvrGradient::analytic:
      return chosen<Sampler, DvrGradient::analytic>(job.native);
    default:
      return chosen<Sampler, DvrGradient::neighbour>(job.native);
  }
}

/// Spreads tiles over threads; `work` draws one. Adds up what they cost.
using DvrWork = std::function<Status(const DvrTile&, DvrCounts&)>;
Status over_tiles(const DvrParams& params, Frame& frame, Context& ctx, const DvrWork& work);

}  // namespace voxkit::render
