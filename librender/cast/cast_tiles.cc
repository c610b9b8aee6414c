// Tiles of pixels, spread over threads.
#include <cmath>
#include <glm/geometric.hpp>

#include "formats/clock.h"
#include "formats/parallel.h"
#include "librender/cast/cast_tile.h"

namespace voxkit::render {
namespace {

constexpr int tile_width = 128, tile_height = 32;  // pixels of a task

}  // namespace

Status cast_tiles(const CastTile& cast_tile, const CastOptions& options, Frame& frame, Context& ctx) {
  VOX_CHECK(frame.begin({.width = options.width, .height = options.height, .details = options.details}, ctx));
  const int64_t across = (options.width + tile_width - 1) / tile_width,
                down = (options.height + tile_height - 1) / tile_height;
  std::vector<TileCounts> counts(static_cast<size_t>(across * down));
  const auto start = Clock::now();
  VOX_CHECK(parallel_for(ctx, across * down, [&](int64_t i) -> Status {
    const int x = static_cast<int>(i % across) * tile_width, y = static_cast<int>(i / across) * tile_height;
    const TileRect tile{x, y, std::min(x + tile_width, options.width),
                        std::min(y + tile_height, options.height)};
    cast_tile(tile, frame.pixels.data(), frame.details.empty() ? nullptr : frame.details.data(),
              counts[static_cast<size_t>(i)]);
    return {};
  }));
  frame.seconds = seconds_since(start);
  for (const TileCounts& count : counts) {
    frame.rays_hit += count.hit;
    frame.cells_visited += count.cells;
    frame.blocks_touched += count.blocks;
    frame.bytes_touched += count.bytes;
  }
  return {};
}

int least_log2(const VolumeInfo& info, const Camera& camera, const CastOptions& options) {
  const RayGenerator rays(camera, options.width, options.height);
  const double pixel = rays.pixel_width() * glm::length(camera.eye) / GridTransform(info).smallest_edge();
  int log2_edge = 2;
  while (log2_edge < 31 && std::ldexp(1, log2_edge) < 4 * pixel) ++log2_edge;
  return log2_edge;
}

}  // namespace voxkit::render
