// Drawing from voxels as they are in memory, of one type: draw_voxels_*.cc has it for each, since each takes
// long to compile.
#pragma once

#include "librender/dvr/dense_sampler.h"
#include "librender/dvr/dvr_tile.h"

namespace voxkit::render {

template <class T>
Status draw_voxels(const DenseGrid& grid, const DvrJob& job, Frame& frame, Context& ctx) {
  using Sampler = DenseSampler<T>;
  const auto draw = chosen<Sampler>(job);
  return over_tiles(job.params, frame, ctx, [&](const DvrTile& tile, DvrCounts& count) -> Status {
    Sampler sampler(grid.view().voxels, job.params.cast.dims);
    draw(job.params, sampler, tile, frame, job.details, count);
    return {};
  });
}

}  // namespace voxkit::render
