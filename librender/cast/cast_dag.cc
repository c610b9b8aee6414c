// Casting compressed surfaces, from their files: the DAG first, then the colours of what was hit.
#include "libcolor/store.h"
#include "librender/cast/cast_tile.h"
#include "librender/cast/glimpses.h"
#include "librender/cast/see_through.h"
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
  CastOptions detailed = options;
  detailed.details = true;  // where to look colours up
  VOX_TRY(CastParams params, surface_params(volume, camera, options));
  VOX_TRY(const std::unique_ptr<Buffer> glimpses, hold_glimpses(params, ctx));
  params.glimpses = glimpses_in(glimpses);
  if (options.traversal == Traversal::restart) {
    VOX_CHECK(cast_with(DagCastView<Search::restart>{dag}, params, detailed, frame, ctx));
  } else if (!options.skip) {
    VOX_CHECK(cast_with(DagCastView<Search::path>{dag}, params, detailed, frame, ctx));
  } else {
    VOX_TRY(const std::shared_ptr<VoidMemo> memo, grid.learned().memo({}, ctx));
    const int least = least_log2(grid.info(), camera, options);
    const BoxedView<DagSpace> all{{{dag}}, &params, memo.get(), least};
    const BoxedView<DagSpace, true> levels{{{dag}}, &params, memo.get(), least};
    VOX_CHECK(glimpses ? cast_with(levels, params, detailed, frame, ctx)
                       : cast_with(all, params, detailed, frame, ctx));
  }
  VOX_CHECK(look_up_colors(volume, params.glimpses, frame, ctx));
  const bool opacities = volume.params().attributes.has(color::Attribute::opacity);
  CastParams all_detail = params;
  all_detail.cone = 0;
  std::vector<uint8_t> translucent;
  if (opacities) {
    VOX_TRY(translucent, see_through(volume, *dag, all_detail, params.glimpses, frame, ctx));
  }
  VOX_CHECK(look_up_traits(volume, options.traits, params.glimpses, frame, ctx));
  if (opacities) VOX_CHECK(shine_through(volume, *dag, all_detail, translucent, frame, ctx));
  if (!options.details) frame.details.clear();
  return {};
}

}  // namespace voxkit::render
