#include "librender/dvr/dvr.h"

#include <algorithm>
#include <cmath>

#include "formats/clock.h"
#include "formats/parallel.h"
#include "librender/cast/cast_params.h"
#include "librender/dvr/dvr_draw.h"
#include "librender/light.h"
#include "libsvmm/store.h"
#include "libvq/store.h"

namespace voxkit::render {
namespace {

constexpr int64_t most_dense_voxels = int64_t{1} << 31;

Status check_scalar(const VolumeInfo& info) {
  if (!is_color(info.format)) return {};
  return bad_input({}, "voxels are " + std::string(name(info.format)) +
                           ": expected a scalar volume for direct volume rendering");
}

Result<DvrParams> dvr_params(const VolumeInfo& info, const Camera& camera, const DvrOptions& options,
                             const TransferFunction& transfer, const BrickSkips& skips) {
  CastOptions cast_options;
  cast_options.width = options.width;
  cast_options.height = options.height;
  VOX_TRY(const CastParams cast, cast_params(info, camera, cast_options));
  const GridTransform transform(info);
  const RayGenerator rays(camera, options.width, options.height);
  const double edge = transform.smallest_edge(), step = options.step * edge;
  // Numbers of samples are exact as floats.
  if (2 * transform.radius() / step > 0x1p23)
    return bad_usage("a ray would take more than 2^23 samples: expected larger steps");
  const glm::dvec3 light = light_of(rays);
  // Gradients in a unit near the width of the transfer function, a power of two, which rounds nothing: so
  // that their squares are neither too large nor too small for floats.
  const double unit = std::ldexp(1.0, -std::min(std::ilogb(transfer.span()), 126)),
               span = transfer.span() * unit;
  const bool from_neighbours = options.gradient == Gradient::neighbour;
  const int64_t longest = std::max({info.dims.x, info.dims.y, info.dims.z});
  DvrParams params{
      .cast = cast,
      .step = step,
      .middle = std::max(0.0, std::floor(glm::dot(-rays.eye(), rays.forward()) / step)),
      .length = static_cast<float>(options.step),
      .margin = static_cast<float>(longest) * 0x1p-19f,
      .shortest = static_cast<float>(longest) * 0x1p-16f,
      .slope = {},
      .unit = static_cast<float>(unit),
      .reach = {},
      .light = {},
      .flat = static_cast<float>(span) * 1e-5f,
      .lit = options.lit,
      .modulate = static_cast<float>(options.modulate / span),
      .table = transfer.table(),
      .first = transfer.first(),
      .scale = transfer.scale(),
      .distances = options.skip ? skips.distances() : nullptr,
      .row = static_cast<int32_t>(skips.row()),
      .slice = static_cast<int32_t>(skips.slice()),
  };
  for (int a = 0; a < 3; ++a) {
    const double per_edge = edge / transform.voxel[a] * (from_neighbours ? 1 : unit);
    for (int world = 0; world < 3; ++world) {
      params.slope[world][a] = static_cast<float>(transform.along[world][a] * per_edge);
      params.reach[world][a] = transform.axes[a][world] * transform.voxel[a];
    }
    params.light[a] = static_cast<float>(light[a]);
  }
  return params;
}

}  // namespace

Result<DvrVolume> DvrVolume::open(std::shared_ptr<const DenseGrid> grid, Context& ctx) {
  VOX_CHECK(check_scalar(grid->info()));
  VOX_TRY(BrickRanges ranges, BrickRanges::of(*grid, ctx));
  DvrVolume volume(grid->info(), std::move(ranges));
  volume.dense_ = std::move(grid);
  return volume;
}
Result<DvrVolume> DvrVolume::open(std::shared_ptr<const svmm::Volume> compressed, Context& ctx) {
  VOX_CHECK(check_scalar(compressed->info()));
  VOX_TRY(BrickRanges ranges, BrickRanges::of(*compressed, ctx));
  DvrVolume volume(compressed->info(), std::move(ranges));
  volume.svmm_ = std::move(compressed);
  return volume;
}
Result<DvrVolume> DvrVolume::open(std::shared_ptr<const vq::Volume> compressed, Context& ctx) {
  VOX_TRY(BrickRanges ranges, BrickRanges::of(*compressed, ctx));
  DvrVolume volume(compressed->info(), std::move(ranges));
  volume.vq_ = std::move(compressed);
  return volume;
}
Result<DvrVolume> DvrVolume::open(std::shared_ptr<const svmm::PackedVolume> compressed, Context& ctx) {
  VOX_CHECK(check_scalar(compressed->info()));
  VOX_TRY(BrickRanges ranges, BrickRanges::of(*compressed, ctx));
  DvrVolume volume(compressed->info_of(compressed->finest()), std::move(ranges));
  volume.packed_ = std::move(compressed);
  return volume;
}

Result<DvrScene> DvrScene::create(std::shared_ptr<const DvrVolume> volume, TransferFunction transfer,
                                  Context& ctx) {
  if (!volume->packed()) {
    VOX_TRY(BrickSkips skips, BrickSkips::create(volume->ranges(), transfer, ctx));
    return DvrScene(std::move(volume), std::move(transfer), std::move(skips), 0);
  }
  const uint64_t pages = volume->packed()->pages_decoded();
  VOX_TRY(const BrickRanges finer, volume->ranges().finer(*volume->packed(), transfer, ctx));
  VOX_TRY(BrickSkips skips, BrickSkips::create(finer, transfer, ctx));
  const uint64_t decoded = volume->packed()->pages_decoded() - pages;
  return DvrScene(std::move(volume), std::move(transfer), std::move(skips), decoded);
}

bool is_direct(const VolumeInfo& info) {
  const Index3& dims = info.dims;
  return std::min({dims.x, dims.y, dims.z}) >= 2 && dims.x * dims.y * dims.z < most_dense_voxels;
}

Status blank_around(const DvrJob& job, Frame& frame, Context& ctx) {
  const CastParams& cast = job.params.cast;
  return parallel_for(ctx, cast.height, [&](int64_t y) -> Status {
    const bool row = y >= cast.top && y < cast.bottom;
    const int left = row ? std::min(cast.left, cast.width) : cast.width,
              right = row ? std::max(left, cast.right) : cast.width;
    const auto blank = [&](int x0, int x1) {
      for (auto i = static_cast<size_t>(y * cast.width + x0); i < static_cast<size_t>(y * cast.width + x1);
           ++i) {
        frame.pixels[i] = {};
        if (!frame.details.empty()) frame.details[i] = {};
        if (!frame.costs.empty()) frame.costs[i] = {};
      }
    };
    blank(0, left);
    blank(right, cast.width);
    return {};
  });
}

Result<DvrJob> dvr_job(const DvrScene& scene, const Camera& camera, const DvrOptions& options) {
  VOX_TRY(const DvrParams params,
          dvr_params(scene.volume().info(), camera, options, scene.transfer(), scene.skips()));
  DvrJob job{
      .params = params,
      .gradient = !options.lit && options.modulate <= 0    ? DvrGradient::none
                  : options.gradient == Gradient::analytic ? DvrGradient::analytic
                                                           : DvrGradient::neighbour,
      .native = options.native,
      .details = options.details,
      .shown = nullptr,
  };
  // Gradients from neighbouring rays need what these have there, seen or not.
  if (options.skip && job.gradient != DvrGradient::neighbour) job.shown = &scene.transfer();
  return job;
}

Status DvrScene::draw(const Camera& camera, const DvrOptions& options, Frame& frame, Context& ctx) const {
  VOX_TRY(const DvrJob job, dvr_job(*this, camera, options));
  VOX_CHECK(frame.begin({.width = options.width, .height = options.height, .details = options.details}, ctx));
  const uint64_t pages = volume_->packed() ? volume_->packed()->pages_decoded() : 0;
  const auto start = Clock::now();
  VOX_CHECK(blank_around(job, frame, ctx));
  if (volume_->dense() && is_direct(volume_->info())) {
    VOX_CHECK(draw_dense(*volume_->dense(), job, frame, ctx));
  } else if (volume_->info().format == VoxelFormat::float32) {
    VOX_CHECK(draw_bricks<float>(*volume_, job, frame, ctx));
  } else {
    VOX_CHECK(draw_bricks<uint16_t>(*volume_, job, frame, ctx));
  }
  frame.seconds = seconds_since(start);
  if (volume_->packed()) frame.pages_decoded = volume_->packed()->pages_decoded() - pages;
  if (volume_->svmm()) return volume_->svmm()->store().status();
  if (volume_->vq()) return volume_->vq()->store().status();
  return {};
}

}  // namespace voxkit::render
