// Casting compressed surfaces, from their files: the DAG first, then the colours of what was hit.
#include "libcolor/store.h"
#include "librender/cast/cast_tile.h"
#include "librender/cast/cast_translucent.h"
#include "librender/cast/surface_colors.h"
#include "librender/cast/surface_traits.h"

namespace voxkit::render {

DagGrid::DagGrid(std::shared_ptr<const color::Volume> volume)
    : volume_(std::move(volume)), learned_(std::make_shared<LearnedVoid>()) {}

Status cast(const DagGrid& grid, const Camera& camera, const CastOptions& options, Frame& frame,
            Context& ctx) {
  if (options.traversal == Traversal::baseline) return only_dense_has_baseline();
  const color::Volume& volume = grid.volume();
  VOX_TRY(const color::DagView* const dag, volume.store().dag(volume.container(), volume.params()));
  VOX_TRY(const CastParams params, cast_params(grid.info(), camera, options));
  CastOptions detailed = options;
  detailed.details = true;  // where to look colours up
  if (volume.params().attributes.has(color::Attribute::opacity)) {
    VOX_CHECK(cast_translucent(volume, *dag, params, detailed, frame, ctx));
    if (!options.details) frame.details.clear();
    return {};
  }
  if (options.traversal == Traversal::restart) {
    VOX_CHECK(cast_with(DagCastView<Search::restart>{dag}, params, detailed, frame, ctx));
  } else if (params.cone > 0 || !options.skip) {
    VOX_CHECK(cast_with(DagCastView<Search::path>{dag}, params, detailed, frame, ctx));
  } else {
    VOX_TRY(const std::shared_ptr<VoidMemo> memo, grid.learned().memo({}, ctx));
    const BoxedView<DagSpace> boxed{{{dag}}, &params, memo.get(), least_log2(grid.info(), camera, options)};
    VOX_CHECK(cast_with(boxed, params, detailed, frame, ctx));
  }
  VOX_CHECK(look_up_traits(volume, options.traits, true, frame, ctx));
  VOX_CHECK(look_up_colors(volume, frame, ctx));
  if (!options.details) frame.details.clear();
  return {};
}

}  // namespace voxkit::render
