// Casting SVMM volumes, from their files.
#include "librender/cast/cast_tile.h"

namespace voxkit::render {

SvmmGrid::SvmmGrid(std::shared_ptr<const svmm::Volume> volume)
    : volume_(std::move(volume)), learned_(std::make_shared<LearnedVoid>()) {}

Status cast(const SvmmGrid& grid, const Camera& camera, const CastOptions& options, Frame& frame,
            Context& ctx) {
  if (options.traversal == Traversal::baseline) return only_dense_has_baseline();
  using svmm::MappedPools;
  const MappedPools pools(grid.volume());
  const svmm::View* view = &grid.volume().store().view;
  const VolumeInfo& info = grid.info();
  VOX_TRY(const CastParams params, cast_params(info, camera, options));
  if (options.traversal == Traversal::restart) {
    const SvmmView<MappedPools, Search::restart> restart{view, &pools};
    VOX_CHECK(cast_with(restart, params, options, frame, ctx));
  } else if (params.cone > 0 || !options.skip) {
    const SvmmView<MappedPools, Search::path> path{view, &pools};
    VOX_CHECK(cast_with(path, params, options, frame, ctx));
  } else {
    VOX_TRY(const std::shared_ptr<VoidMemo> memo, grid.learned().memo(options.range, ctx));
    const BoxedView<SvmmSpace> boxed{
        {view, &pools, {&params.color_of}}, &params, memo.get(), least_log2(info, camera, options)};
    VOX_CHECK(cast_with(boxed, params, options, frame, ctx));
  }
  return grid.volume().store().status();
}

}  // namespace voxkit::render
