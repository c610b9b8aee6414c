// Casting packed volumes, page by page.
#include "librender/cast/cast_tile.h"
#include "librender/cast/packed_grid.h"

namespace voxkit::render {

PackedGrid::PackedGrid(std::shared_ptr<const svmm::PackedVolume> volume) : volume_(std::move(volume)) {
  info_ = volume_->info_of(volume_->finest());
}

Status cast(const PackedGrid& grid, const Camera& camera, const CastOptions& options, Frame& frame,
            Context& ctx) {
  if (options.traversal == Traversal::baseline) return only_dense_has_baseline();
  VOX_TRY(const CastParams params, cast_params(grid.info(), camera, options));
  const uint64_t decoded = grid.volume().pages_decoded();
  FirstError error;
  VOX_CHECK(cast_with(PackedCastView{&grid.volume(), &error}, params, options, frame, ctx));
  frame.pages_decoded = grid.volume().pages_decoded() - decoded;
  return error.status();
}

}  // namespace voxkit::render
