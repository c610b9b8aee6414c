#include "librender/dvr/dvr_draw.h"

#include "formats/parallel.h"
#include "librender/dvr/dvr_tile.h"

namespace voxkit::render {
namespace {

constexpr int tile_edge = 64;

}  // namespace

Status over_tiles(const DvrParams& params, Frame& frame, Context& ctx, const DvrWork& work) {
  const CastParams& cast = params.cast;
  const int width = cast.right - cast.left, height = cast.bottom - cast.top;
  const int64_t across = (width + tile_edge - 1) / tile_edge, down = (height + tile_edge - 1) / tile_edge;
  if (width <= 0 || height <= 0) return {};
  std::vector<DvrCounts> counts(static_cast<size_t>(across * down));
  VOX_CHECK(parallel_for(ctx, across * down, [&](int64_t i) -> Status {
    const int x = cast.left + static_cast<int>(i % across) * tile_edge,
              y = cast.top + static_cast<int>(i / across) * tile_edge;
    const DvrTile tile{x, y, std::min(x + tile_edge, cast.right), std::min(y + tile_edge, cast.bottom)};
    return work(tile, counts[static_cast<size_t>(i)]);
  }));
  for (const DvrCounts& count : counts) {
    frame.rays_hit += count.hit;
    frame.cells_visited += count.bricks;
    frame.samples += count.samples;
    frame.blocks_touched += count.decoded;
  }
  return {};
}

Status draw_dense(const DenseGrid& grid, const DvrJob& job, Frame& frame, Context& ctx) {
  switch (voxel_bytes(grid.info().format)) {
    case 1:
      return draw_voxels<uint8_t>(grid, job, frame, ctx);
    case 2:
      return draw_voxels<uint16_t>(grid, job, frame, ctx);
    default:
      return draw_voxels<float>(grid, job, frame, ctx);
  }
}

}  // namespace voxkit::render
