// Casting packed volumes of colours, from their files: masks first, then the colours of what was hit.
#include <fmt/format.h>

#include "formats/clock.h"
#include "formats/parallel.h"
#include "librender/cast/cast_tile.h"
#include "librender/cast/mask_grid.h"

namespace voxkit::render {
namespace {

/// Gives each pixel the colour of the voxel that its ray hit. Adds its time to `frame`.
Status look_up(const svmm::PackedVolume& volume, Frame& frame, Context& ctx) {
  const auto start = Clock::now();
  const ColorOf color_of(VoxelFormat::rgba32, {});
  const bool has_alpha = volume.info().format == VoxelFormat::rgba32;
  constexpr int64_t side = 32;  // of tiles: neighbours are mostly in one page
  const int64_t across = (frame.width + side - 1) / side, down = (frame.height + side - 1) / side;
  VOX_CHECK(parallel_for(ctx, across * down, [&](int64_t tile) -> Status {
    svmm::PackedVolume::Reader reader(volume, 0);
    const int64_t x0 = tile % across * side, y0 = tile / across * side;
    for (int64_t y = y0; y < std::min<int64_t>(y0 + side, frame.height); ++y)
      for (int64_t x = x0; x < std::min<int64_t>(x0 + side, frame.width); ++x) {
        const auto i = static_cast<size_t>(y * frame.width + x);
        const int32_t(&voxel)[3] = frame.details[i].voxel;
        if (voxel[0] < 0) continue;
        VOX_TRY(const Voxel value, reader.at({voxel[0], voxel[1], voxel[2]}));
        if (has_alpha && value.as<uint32_t>() >> 24 != 255)
          return bad_input(volume.container().name(),
                           fmt::format("chunk PAKP, byte 3: voxel {},{},{} is not opaque: expected all to be",
                                       voxel[0], voxel[1], voxel[2]));
        const Color seen = color_of(Voxel::of(value.as<uint32_t>() | 0xff000000u));
        for (int k = 0; k < 3; ++k) frame.pixels[i].color[k] = seen.rgb[k];
      }
    return {};
  }));
  frame.lookup_seconds = seconds_since(start);
  frame.seconds += frame.lookup_seconds;
  return {};
}

}  // namespace

Status cast(const MaskGrid& grid, const Camera& camera, const CastOptions& options, Frame& frame,
            Context& ctx) {
  if (options.traversal == Traversal::baseline) return only_dense_has_baseline();
  const svmm::MaskView tree = grid.tree().view();
  VOX_TRY(const CastParams params, cast_params(grid.info(), camera, options));
  CastOptions detailed = options;
  detailed.details = true;  // where to look colours up
  if (options.traversal == Traversal::restart) {
    VOX_CHECK(cast_with(MaskCastView<Search::restart>{&tree}, params, detailed, frame, ctx));
  } else if (!options.skip) {
    VOX_CHECK(cast_with(MaskCastView<Search::path>{&tree}, params, detailed, frame, ctx));
  } else {
    VOX_TRY(const std::shared_ptr<VoidMemo> memo, grid.learned().memo({}, ctx));
    const BoxedView<MaskSpace> boxed{
        {{&tree}}, &params, memo.get(), least_log2(grid.info(), camera, options)};
    VOX_CHECK(cast_with(boxed, params, detailed, frame, ctx));
  }
  const uint64_t decoded = grid.volume().pages_decoded();
  VOX_CHECK(look_up(grid.volume(), frame, ctx));
  frame.pages_decoded = grid.volume().pages_decoded() - decoded;
  if (!options.details) frame.details.clear();
  return {};
}

}  // namespace voxkit::render
