#include "librender/cast/cast_params.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace voxkit::render {
namespace {

/// The pixels that may see the volume: those around its corners; all of them where a corner is not in
/// front of the eye.
void bound_pixels(const RayGenerator& rays, const GridTransform& transform, CastParams& params) {
  double left = params.width, right = 0, top = params.height, bottom = 0;
  for (int i = 0; i < 8; ++i) {
    const glm::dvec3 to = transform.corner(i) - rays.eye();
    const double depth = glm::dot(to, rays.forward()) * rays.pixel_width();
    if (!(depth > 1e-9 * rays.pixel_width())) return;
    const double x = params.width * 0.5 + glm::dot(to, rays.right()) / depth,
                 y = params.height * 0.5 - glm::dot(to, rays.up()) / depth;
    left = std::min(left, x), right = std::max(right, x);
    top = std::min(top, y), bottom = std::max(bottom, y);
  }
  // A pixel more on each side, for rounding and for the eye that was moved to a multiple of 2^-20 voxels.
  const auto clamp = [](double v, int most) {
    return static_cast<int>(std::clamp(v, 0.0, static_cast<double>(most)));
  };
  params.left = clamp(std::floor(left) - 1, params.width);
  params.right = clamp(std::ceil(right) + 1, params.width);
  params.top = clamp(std::floor(top) - 1, params.height);
  params.bottom = clamp(std::ceil(bottom) + 1, params.height);
}

}  // namespace

Result<CastParams> cast_params(const VolumeInfo& info, const Camera& camera, const CastOptions& options) {
  const GridTransform transform(info);
  if (!(transform.radius() < 0x1p31 * transform.smallest_edge()))
    return bad_input(
        {},
        "the edges of its voxels are too unequal: expected it to be less than 2^31 of the shortest across");
  const RayGenerator rays(camera, options.width, options.height);
  const glm::dvec3 eye = transform.point(rays.eye());
  for (int a = 0; a < 3; ++a)
    if (!(std::abs(eye[a]) < 0x1p31 - 1))
      return bad_usage("the camera is too far away: expected less than 2^31 voxels");
  const int64_t dims[3] = {info.dims.x, info.dims.y, info.dims.z};
  const double origin[3] = {eye.x, eye.y, eye.z};
  const glm::dvec3 across = transform.direction(rays.right() * rays.pixel_width()),
                   down = transform.direction(rays.up() * -rays.pixel_width()),
                   corner = transform.direction(rays.forward()) - across * (options.width * 0.5) -
                            down * (options.height * 0.5);
  CastParams params{
      .width = options.width,
      .height = options.height,
      .left = 0,
      .top = 0,
      .right = options.width,
      .bottom = options.height,
      .dims = {info.dims.x, info.dims.y, info.dims.z},
      .origin = {eye.x, eye.y, eye.z},
      .start = RayOrigin(origin, dims),
      .corner = {corner.x, corner.y, corner.z},
      .across = {across.x, across.y, across.z},
      .down = {down.x, down.y, down.z},
      .pixel = rays.pixel_width(),
      .edge = transform.smallest_edge(),
      .cone = 0,
      .coarsest = -1,
      .skip = options.skip,
      .color_of = ColorOf(info.format, options.range),
  };
  // Where not even the farthest corner is two voxels to a pixel, every ray sees all detail.
  const double farthest = glm::length(rays.eye()) + transform.radius();
  const double cone = params.pixel / params.edge;
  if (options.level_of_detail && cone * farthest >= 2) {
    params.cone = cone;
    params.coarsest = finest_parts_log2(cone * farthest);
  }
  bound_pixels(rays, transform, params);
  return params;
}

void add_up(Frame& frame) {
  for (size_t i = 0; i < frame.costs.size(); ++i) {
    frame.rays_hit += frame.details[i].voxel[0] >= 0;
    frame.cells_visited += frame.details[i].cells;
    frame.blocks_touched += frame.costs[i].blocks;
    frame.bytes_touched += frame.costs[i].bytes;
  }
}

Status only_dense_has_baseline() {
  return bad_usage("the baseline traversal steps through uncompressed volumes: expected path or restart");
}

}  // namespace voxkit::render
