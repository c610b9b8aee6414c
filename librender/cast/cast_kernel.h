// The work of one pixel, on the host or a device (thesis sections 3.2.1 to 3.2.5).
#pragma once

#include <bit>
#include <cmath>
#include <type_traits>

#include "librender/cast/beam.h"
#include "librender/cast/grid.h"
#include "librender/cast/opacity.h"
#include "librender/cast/ray.h"
#include "librender/pixel.h"

namespace voxkit::render {

/// What all pixels of a picture share.
struct CastParams {
  int width, height;
  int left, top, right, bottom;  ///< pixels outside of left <= x < right, top <= y < bottom see nothing
  int64_t dims[3];               ///< of the grid
  double origin[3];              ///< the eye in grid coordinates
  RayOrigin start;               ///< the same
  double corner[3], across[3], down[3];  ///< direction at (x, y): corner + x * across + y * down
  double pixel;                          ///< width of a pixel at distance 1 along the axis
  double edge;                           ///< smallest edge of a voxel, world units
  double cone;                           ///< width of a pixel at distance 1 in voxels; 0: all detail
  int coarsest;  ///< of surfaces, unless cone is 0: log2 of the edge of the coarsest cells that rays look at
  bool skip;     ///< step over cells, not voxels
  ColorOf color_of;
  Glimpse* glimpses = nullptr;  ///< of surfaces, unless cone is 0: Beam::most_cells a pixel
};
constexpr float opaque = 0.995f;

/// The direction through a pixel's centre in grid coordinates; t = 1 is where it is 1 away along the axis.
struct PixelRay {
  double direction[3];
};
VOX_HD_HOT PixelRay ray_through(const CastParams& params, int x, int y) {
  PixelRay ray;
  const double u = x + 0.5, v = y + 0.5;
  for (int a = 0; a < 3; ++a)
    ray.direction[a] = params.corner[a] + (params.across[a] * u + params.down[a] * v);
  return ray;
}
/// The length of that in the world.
VOX_HD_HOT double world_length(const CastParams& params, int x, int y) {
  const double right = (x + 0.5 - params.width * 0.5) * params.pixel,
               up = (y + 0.5 - params.height * 0.5) * params.pixel;
  return std::sqrt(1 + (right * right + up * up));
}

/// Front-to-back blending of `length` base voxels of one colour; true when the ray has become opaque.
VOX_HD_HOT bool blend(const Color& color, double length, Pixel& pixel) {
  const float alpha = static_cast<float>(coverage(static_cast<double>(color.alpha), length));
  const float weight = alpha * (1 - pixel.color[3]);
  for (int k = 0; k < 3; ++k) pixel.color[k] += weight * color.rgb[k];
  pixel.color[3] += weight;
  return pixel.color[3] >= opaque;
}

/// Keeps where the first voxel that is not void was entered.
VOX_HD_HOT void found(const uint32_t (&voxel)[3], double distance, Pixel& pixel, PixelDetail& detail) {
  pixel.distance = static_cast<float>(distance);
  for (int a = 0; a < 3; ++a) detail.voxel[a] = static_cast<int32_t>(voxel[a]);
}

/// Voxels as wide as a cone, or less, are fine enough: floor(log2(width)); all detail, -1, below 2.
VOX_HD_HOT int finest_log2(double width) {
  return width >= 2 ? static_cast<int>(std::bit_cast<uint64_t>(width) >> 52) - 1023 : -1;
}

/// The same for surfaces, where cells have 4^3 parts, and are words at least: half a level finer, as a part
/// hides all that is behind it, however little of it is there.
VOX_HD_HOT int finest_parts_log2(double width) {
  if (!(width >= 2)) return -1;
  const int log2_edge = finest_log2(width * 0.70710678118654752);
  return log2_edge < 2 ? 2 : log2_edge;
}

/// Follows a ray over the cells of a grid, from the voxel that it is in. Nothing was found so far.
template <class Cursor>
VOX_HD_HOT void follow(const CastParams& params, GridRay& ray, Cursor& cursor, int x, int y, Pixel& pixel,
                       PixelDetail& detail) {
  const double length = world_length(params, x, y);
  const double cone = params.cone * length;
  for (bool inside = true; inside;) {
    const int finest = finest_log2(cone * ray.t());
    const uint32_t voxel[3] = {ray.voxel(0), ray.voxel(1), ray.voxel(2)};
    const auto cell = cursor.locate(voxel[0], voxel[1], voxel[2], finest);
    ++detail.cells;
    if (params.color_of.is_void(cell.value)) {
      inside = params.skip ? cell.leave(ray) : ray.leave(0);
      continue;
    }
    const double entered = ray.t();
    if (detail.voxel[0] < 0) found(voxel, entered * length, pixel, detail);
    const Color color = params.color_of(cell.value);
    if (color.alpha < 1) inside = params.skip ? cell.leave(ray) : ray.leave(0);  // opaque: not left
    if (blend(color, (ray.t() - entered) * length / params.edge, pixel)) break;
  }
}

/// Follows the ray through a pixel of a surface with levels of detail, from the voxel that it is in. Cells
/// that are fine enough hide a part of the pixel; what they are goes to its glimpses.
template <class Cursor>
VOX_HD_HOT void follow_levels(const CastParams& params, GridRay& ray, Cursor& cursor, int x, int y,
                              Pixel& pixel, PixelDetail& detail) {
  const double length = world_length(params, x, y);
  const double cone = params.cone * length;
  Glimpse* glimpse = params.glimpses + (int64_t{y} * params.width + x) * Beam::most_cells;
  Glimpse* const end = glimpse + Beam::most_cells;
  Beam beam(params.origin, ray_through(params, x, y).direction);
  bool clear = true;  // nothing was found, or hardly anything
  for (bool inside = true; inside;) {
    const uint32_t voxel[3] = {ray.voxel(0), ray.voxel(1), ray.voxel(2)};
    const double width = cone * ray.t();
    const auto& cell = cursor.locate(voxel[0], voxel[1], voxel[2], finest_parts_log2(width));
    ++detail.cells;
    if (params.color_of.is_void(cell.value)) {
      inside = cell.leave(ray);
      continue;
    }
    const int log2_edge = static_cast<int>(cell.value.template as<uint32_t>() & 0xff);
    double t = ray.t();
    const int ninths = log2_edge == 0 ? beam.hide_all() : beam.hide(cursor.parts(cell), voxel, log2_edge, t);
    if (ninths > 0) {
      constexpr int significant = 3;
      if (clear && (detail.voxel[0] < 0 || ninths >= significant)) found(voxel, t * length, pixel, detail);
      clear &= ninths < significant;
      const int seen = finest_log2(width) > log2_edge ? finest_log2(width) : log2_edge;
      *glimpse = {{}, static_cast<int16_t>(log2_edge == 0 ? 0 : seen), static_cast<int16_t>(ninths)};
      for (int a = 0; a < 3; ++a) glimpse->voxel[a] = static_cast<int32_t>(voxel[a]);
      ++glimpse;
    }
    if (beam.open() == 0) break;
    inside = ray.leave(log2_edge);
  }
  pixel.color[3] = static_cast<float>(9 - beam.open()) * (1.0f / 9);
  for (; glimpse < end; ++glimpse) glimpse->ninths = 0;
}
/// Cursors that have parts of cells.
template <class Cursor>
concept HasParts = requires {
  &Cursor::parts;
};

/// Algorithm 1 of the thesis as it is published: floats, accumulated from voxel to voxel.
VOX_HD_HOT void follow_baseline(const CastParams& params, DenseView::Cursor& cursor, int x, int y,
                                Pixel& pixel, PixelDetail& detail) {
  const PixelRay through = ray_through(params, x, y);
  const double length = world_length(params, x, y);
  const int64_t(&dims)[3] = params.dims;
  float o[3], d[3], delta[3], t_max[3], t_enter = 0, t_leave = __builtin_inff();
  for (int a = 0; a < 3; ++a) {
    o[a] = static_cast<float>(params.origin[a]);
    d[a] = static_cast<float>(through.direction[a]);
    const float side = static_cast<float>(dims[a]);
    if (d[a] == 0 && (o[a] < 0 || o[a] >= side)) return;
    if (d[a] == 0) continue;
    const float near = (d[a] < 0 ? side - o[a] : -o[a]) / d[a], far = (d[a] < 0 ? -o[a] : side - o[a]) / d[a];
    t_enter = near > t_enter ? near : t_enter;
    t_leave = far < t_leave ? far : t_leave;
  }
  if (t_enter >= t_leave) return;
  int64_t voxel[3], step[3];
  for (int a = 0; a < 3; ++a) {
    const float at = o[a] + d[a] * t_enter;
    const int64_t whole = static_cast<int64_t>(std::floor(at));
    voxel[a] = whole < 0 ? 0 : whole >= dims[a] ? dims[a] - 1 : whole;
    step[a] = d[a] < 0 ? -1 : 1;
    delta[a] = d[a] == 0 ? __builtin_inff() : std::fabs(1 / d[a]);
    t_max[a] =
        d[a] == 0 ? delta[a] : t_enter + (static_cast<float>(voxel[a] + (d[a] < 0 ? 0 : 1)) - at) / d[a];
  }
  for (float t = t_enter;;) {
    const Cell cell = cursor.locate(static_cast<uint32_t>(voxel[0]), static_cast<uint32_t>(voxel[1]),
                                    static_cast<uint32_t>(voxel[2]), -1);
    ++detail.cells;
    const int axis = t_max[0] <= t_max[1] ? (t_max[0] <= t_max[2] ? 0 : 2) : (t_max[1] <= t_max[2] ? 1 : 2);
    const float entered = t;
    t = t_max[axis];
    if (!params.color_of.is_void(cell.value)) {
      if (detail.voxel[0] < 0) {
        pixel.distance = static_cast<float>(static_cast<double>(entered) * length);
        for (int a = 0; a < 3; ++a) detail.voxel[a] = static_cast<int32_t>(voxel[a]);
      }
      const double crossed = static_cast<double>(t - entered) * length / params.edge;
      if (blend(params.color_of(cell.value), crossed, pixel)) break;
    }
    t_max[axis] += delta[axis];
    voxel[axis] += step[axis];
    if (voxel[axis] < 0 || voxel[axis] >= dims[axis]) break;
  }
}

/// Chooses Algorithm 1.
struct BaselineView {
  DenseView dense;
  struct Cursor : DenseView::Cursor {};
  VOX_HD_HOT Cursor cursor() const { return {dense.cursor()}; }
};

/// The pixel (x, y) of any view.
template <class Cursor>
VOX_HD_HOT void cast_ray(const CastParams& params, Cursor& cursor, int x, int y, Pixel& pixel,
                         PixelDetail& detail) {
  if constexpr (std::is_same_v<Cursor, BaselineView::Cursor>) {
    follow_baseline(params, cursor, x, y, pixel, detail);
  } else {
    GridRay ray(params.start, ray_through(params, x, y).direction);
    if (!ray.enter()) return;
    if constexpr (HasParts<Cursor>) {
      if (params.glimpses != nullptr) return follow_levels(params, ray, cursor, x, y, pixel, detail);
    }
    follow(params, ray, cursor, x, y, pixel, detail);
  }
}

}  // namespace voxkit::render
