#include "librender/dvr/dvr_draw.h"

#include <bit>
#include <mutex>

#include "formats/parallel.h"
#include "librender/dvr/brick_sampler.h"
#include "librender/dvr/dense_sampler.h"

namespace voxkit::render {
namespace {

constexpr int tile_edge = 64;

struct Tile {
  int x0, y0, x1, y1;
};
struct Counts {
  uint64_t hit = 0, bricks = 0, samples = 0, decoded = 0;
};

/// What a packet found becomes pixels.
template <class Lanes>
[[gnu::always_inline]] inline void keep(const DvrParams& params, const DvrPixels<Lanes>& found, int x, int y,
                                        DvrFrame& frame, bool details, Counts& count) {
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
[[gnu::always_inline]] inline void draw_tile(const DvrParams& params, Sampler& sampler, const Tile& tile,
                                             DvrFrame& frame, bool details, Counts& count) {
  for (int y = tile.y0; y < tile.y1; y += Lanes::height)
    for (int x = tile.x0; x < tile.x1; x += Lanes::width) {
      DvrPixels<Lanes> found;
      march<Lanes, Sampler, kind>(params, sampler, x, y, found);
      keep(params, found, x, y, frame, details, count);
    }
}

// The same code for two kinds of machine.
template <DvrGradient kind, class Sampler>
void draw_generic(const DvrParams& params, Sampler& sampler, const Tile& tile, DvrFrame& frame, bool details,
                  Counts& count) {
  draw_tile<PortableLanes, kind>(params, sampler, tile, frame, details, count);
}
#if defined(__x86_64__) && !defined(VOXKIT_SCALAR)
template <DvrGradient kind, class Sampler>
[[gnu::target("avx2")]] void draw_avx2(const DvrParams& params, Sampler& sampler, const Tile& tile,
                                       DvrFrame& frame, bool details, Counts& count) {
  draw_tile<Avx2Lanes, kind>(params, sampler, tile, frame, details, count);
}
#endif

template <class Sampler>
using Draw = void (*)(const DvrParams&, Sampler&, const Tile&, DvrFrame&, bool, Counts&);

template <class Sampler, DvrGradient kind>
Draw<Sampler> chosen(bool native) {
#if defined(__x86_64__) && !defined(VOXKIT_SCALAR)
  if (native && __builtin_cpu_supports("avx2")) return draw_avx2<kind, Sampler>;
#else
  (void)native;
#endif
  return draw_generic<kind, Sampler>;
}
template <class Sampler>
Draw<Sampler> chosen(const DvrJob& job) {
  switch (job.gradient) {
    case DvrGradient::none:
      return chosen<Sampler, DvrGradient::none>(job.native);
    case DvrGradient::analytic:
      return chosen<Sampler, DvrGradient::analytic>(job.native);
    default:
      return chosen<Sampler, DvrGradient::neighbour>(job.native);
  }
}

/// Spreads tiles over threads; `work` draws one.
template <class Work>
Status over_tiles(const DvrParams& params, DvrFrame& frame, Context& ctx, const Work& work) {
  const CastParams& cast = params.cast;
  const int width = cast.right - cast.left, height = cast.bottom - cast.top;
  const int64_t across = (width + tile_edge - 1) / tile_edge, down = (height + tile_edge - 1) / tile_edge;
  if (width <= 0 || height <= 0) return {};
  std::vector<Counts> counts(static_cast<size_t>(across * down));
  VOX_CHECK(parallel_for(ctx, across * down, [&](int64_t i) -> Status {
    const int x = cast.left + static_cast<int>(i % across) * tile_edge,
              y = cast.top + static_cast<int>(i / across) * tile_edge;
    const Tile tile{x, y, std::min(x + tile_edge, cast.right), std::min(y + tile_edge, cast.bottom)};
    return work(tile, counts[static_cast<size_t>(i)]);
  }));
  for (const Counts& count : counts) {
    frame.rays_hit += count.hit;
    frame.cells_visited += count.bricks;
    frame.samples += count.samples;
    frame.blocks_touched += count.decoded;
  }
  return {};
}

template <class T>
Status draw_voxels(const DenseGrid& grid, const DvrJob& job, DvrFrame& frame, Context& ctx) {
  using Sampler = DenseSampler<T>;
  const auto draw = chosen<Sampler>(job);
  return over_tiles(job.params, frame, ctx, [&](const Tile& tile, Counts& count) -> Status {
    Sampler sampler(grid.view().voxels, job.params.cast.dims);
    draw(job.params, sampler, tile, frame, job.details, count);
    return {};
  });
}

}  // namespace

Status draw_dense(const DenseGrid& grid, const DvrJob& job, DvrFrame& frame, Context& ctx) {
  switch (voxel_bytes(grid.info().format)) {
    case 1:
      return draw_voxels<uint8_t>(grid, job, frame, ctx);
    case 2:
      return draw_voxels<uint16_t>(grid, job, frame, ctx);
    default:
      return draw_voxels<float>(grid, job, frame, ctx);
  }
}

template <class T>
Status draw_bricks(const DvrVolume& volume, const DvrJob& job, DvrFrame& frame, Context& ctx) {
  using Sampler = BrickSampler<T>;
  const auto draw = chosen<Sampler>(job);
  std::mutex mutex;
  std::vector<std::unique_ptr<BrickCache<T>>> idle;  // as many as threads
  const auto take = [&]() -> std::unique_ptr<BrickCache<T>> {
    {
      const std::lock_guard lock(mutex);
      if (!idle.empty()) {
        auto cache = std::move(idle.back());
        idle.pop_back();
        return cache;
      }
    }
    return std::make_unique<BrickCache<T>>(volume.vq()     ? brick_reader<T>(volume.vq(), job.shown)
                                           : volume.svmm() ? brick_reader<T>(volume.svmm())
                                                           : brick_reader<T>(volume.dense()));
  };
  VOX_CHECK(over_tiles(job.params, frame, ctx, [&](const Tile& tile, Counts& count) -> Status {
    auto cache = take();
    cache->forget();  // what a tile costs depends on nothing else
    const uint64_t before = cache->reader().decoded();
    Sampler sampler(*cache);
    draw(job.params, sampler, tile, frame, job.details, count);
    count.decoded = cache->reader().decoded() - before;
    const std::lock_guard lock(mutex);
    idle.push_back(std::move(cache));
    return {};
  }));
  for (size_t word = 0; !idle.empty() && word < idle[0]->reader().places().size(); ++word) {
    uint64_t places = 0;
    for (const auto& cache : idle) places |= cache->reader().places()[word];
    frame.bricks_decoded += static_cast<uint64_t>(std::popcount(places));
  }
  return {};
}

template Status draw_bricks<uint16_t>(const DvrVolume&, const DvrJob&, DvrFrame&, Context&);
template Status draw_bricks<float>(const DvrVolume&, const DvrJob&, DvrFrame&, Context&);

}  // namespace voxkit::render
