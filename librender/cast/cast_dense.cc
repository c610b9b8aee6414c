// Casting uncompressed volumes.
#include "librender/cast/cast_tile.h"

namespace voxkit::render {

Status cast(const DenseGrid& grid, const Camera& camera, const CastOptions& options, Frame& frame,
            Context& ctx) {
  VOX_TRY(const CastParams params, cast_params(grid.info(), camera, options));
  return options.traversal == Traversal::baseline
             ? cast_with(BaselineView{grid.view()}, params, options, frame, ctx)
             : cast_with(grid.view(), params, options, frame, ctx);
}

}  // namespace voxkit::render
