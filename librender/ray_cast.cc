#include "librender/ray_cast.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <type_traits>

#include "formats/parallel.h"
#include "librender/ray.h"

namespace voxkit::render {
namespace {

constexpr float opaque = 0.995f;
constexpr int tile = 32;  // pixels along the edge of a task

struct Colour {
  float rgb[3], alpha;
};

/// The colour and opacity of a voxel.
class ColourOf {
 public:
  ColourOf(VoxelFormat format, const ValueRange& range)
      : format_(format), lo_(range.lo), scale_(range.hi > range.lo ? 1 / (range.hi - range.lo) : 0) {}
  Colour operator()(const Voxel& v) const {
    const auto byte = [&](size_t k) { return static_cast<float>(std::to_integer<int>(v.bytes[k])) / 255; };
    switch (format_) {
      case VoxelFormat::rgba32:
        return {{byte(0), byte(1), byte(2)}, byte(3)};
      case VoxelFormat::rgb24:
        return {{byte(0), byte(1), byte(2)}, v == Voxel{} ? 0.0f : 1.0f};
      case VoxelFormat::bitmap:
        return grey(std::to_integer<int>(v.bytes[0]));
      case VoxelFormat::density8:
        return grey((std::to_integer<int>(v.bytes[0]) - lo_) * scale_);
      case VoxelFormat::density16:
        return grey((v.as<uint16_t>() - lo_) * scale_);
      case VoxelFormat::float32:
        return grey((static_cast<double>(v.as<float>()) - lo_) * scale_);
    }
    return {};
  }

 private:
  static Colour grey(double x) {
    const float d = static_cast<float>(x > 0 ? std::min(x, 1.0) : 0);  // NaN is void
    return {{d, d, d}, d};
  }
  VoxelFormat format_;
  double lo_, scale_;
};

/// Front-to-back blending of `length` base voxels of one colour; true when the ray has become opaque.
bool blend(const Colour& colour, double length, Pixel& pixel) {
  const float alpha = colour.alpha >= 1
                          ? 1.0f
                          : static_cast<float>(1 - std::pow(1 - static_cast<double>(colour.alpha), length));
  const float weight = alpha * (1 - pixel.colour[3]);
  for (int k = 0; k < 3; ++k) pixel.colour[k] += weight * colour.rgb[k];
  pixel.colour[3] += weight;
  return pixel.colour[3] >= opaque;
}

/// Follows one ray (sections 3.2.1 to 3.2.4).
template <class Cursor>
Pixel follow(GridRay& ray, Cursor& cursor, const ColourOf& colour_of, double cone, double edge) {
  Pixel pixel;
  double t = 0;
  if (!ray.enter(t)) return pixel;
  Cell cell;
  for (bool inside = true; inside;) {
    const int64_t voxel[3] = {ray.voxel(0), ray.voxel(1), ray.voxel(2)};
    cursor.locate(voxel, cone * t, cell);
    ++pixel.cells;
    const Colour colour = colour_of(cell.value);
    const double entered = t;
    inside = ray.leave(cell.lo, cell.hi, t);
    if (colour.alpha <= 0) continue;
    if (pixel.voxel[0] < 0) {
      pixel.distance = static_cast<float>(entered);
      for (int a = 0; a < 3; ++a) pixel.voxel[a] = static_cast<int32_t>(voxel[a]);
    }
    if (blend(colour, (t - entered) / edge, pixel)) break;
  }
  return pixel;
}

/// Algorithm 1 of the thesis as it is published: floats, accumulated from voxel to voxel.
Pixel follow_baseline(const double (&origin)[3], const double (&direction)[3], const int64_t (&dims)[3],
                      DenseGrid::Cursor& cursor, const ColourOf& colour_of, double edge) {
  Pixel pixel;
  float o[3], d[3], delta[3], t_max[3], t_enter = 0, t_leave = std::numeric_limits<float>::infinity();
  for (int a = 0; a < 3; ++a) {
    o[a] = static_cast<float>(origin[a]);
    d[a] = static_cast<float>(direction[a]);
    const float near = (d[a] < 0 ? static_cast<float>(dims[a]) - o[a] : -o[a]) / d[a];
    const float far = (d[a] < 0 ? -o[a] : static_cast<float>(dims[a]) - o[a]) / d[a];
    if (d[a] == 0 && (o[a] < 0 || o[a] >= static_cast<float>(dims[a]))) return pixel;
    if (d[a] == 0) continue;
    t_enter = std::max(t_enter, near);
    t_leave = std::min(t_leave, far);
  }
  if (t_enter >= t_leave) return pixel;
  int64_t voxel[3], step[3];
  for (int a = 0; a < 3; ++a) {
    const float at = o[a] + d[a] * t_enter;
    voxel[a] = std::clamp<int64_t>(static_cast<int64_t>(std::floor(at)), 0, dims[a] - 1);
    step[a] = d[a] < 0 ? -1 : 1;
    delta[a] = d[a] == 0 ? std::numeric_limits<float>::infinity() : std::abs(1 / d[a]);
    t_max[a] =
        d[a] == 0 ? delta[a] : t_enter + (static_cast<float>(voxel[a] + (d[a] < 0 ? 0 : 1)) - at) / d[a];
  }
  Cell cell;
  for (float t = t_enter;;) {
    cursor.locate(voxel, 0, cell);
    ++pixel.cells;
    const int axis = t_max[0] <= t_max[1] ? (t_max[0] <= t_max[2] ? 0 : 2) : (t_max[1] <= t_max[2] ? 1 : 2);
    const float entered = t;
    t = t_max[axis];
    if (const Colour colour = colour_of(cell.value); colour.alpha > 0) {
      if (pixel.voxel[0] < 0) {
        pixel.distance = entered;
        for (int a = 0; a < 3; ++a) pixel.voxel[a] = static_cast<int32_t>(voxel[a]);
      }
      if (blend(colour, static_cast<double>(t - entered) / edge, pixel)) break;
    }
    t_max[axis] += delta[axis];
    voxel[axis] += step[axis];
    if (voxel[axis] < 0 || voxel[axis] >= dims[axis]) break;
  }
  return pixel;
}

template <class Grid, class Cursor>
Result<Frame> cast_with(const Grid& grid, const Camera& camera, const CastOptions& options, Context& ctx) {
  const VolumeInfo& info = grid.info();
  const GridTransform transform(info);
  const RayGenerator rays(camera, options.width, options.height);
  const ColourOf colour_of(info.format, options.range);
  const glm::dvec3 eye = transform.point(rays.eye());
  const double origin[3] = {GridRay::quantise(eye.x), GridRay::quantise(eye.y), GridRay::quantise(eye.z)};
  for (const double o : origin)
    if (!(std::abs(o) < 0x1p31))
      return bad_usage("the camera is too far away: expected less than 2^31 voxels");
  const int64_t dims[3] = {info.dims.x, info.dims.y, info.dims.z};
  const double edge = transform.smallest_edge();
  // A cell's edge in base voxels must not be wider than the cone at t.
  const double cone = options.level_of_detail ? rays.pixel_width() / edge : 0;

  Frame frame;
  frame.width = options.width;
  frame.height = options.height;
  frame.pixels.resize(static_cast<size_t>(options.width) * static_cast<size_t>(options.height));
  const int64_t across = (options.width + tile - 1) / tile, down = (options.height + tile - 1) / tile;
  std::vector<Frame> counts(static_cast<size_t>(across * down));
  const auto start = std::chrono::steady_clock::now();
  VOX_CHECK(parallel_for(ctx, across * down, [&](int64_t i) -> Status {
    Cursor cursor(grid);
    Frame& count = counts[static_cast<size_t>(i)];
    const int x0 = static_cast<int>(i % across) * tile, y0 = static_cast<int>(i / across) * tile;
    for (int y = y0; y < std::min(y0 + tile, options.height); ++y)
      for (int x = x0; x < std::min(x0 + tile, options.width); ++x) {
        const glm::dvec3 d = transform.direction(rays.direction(x + 0.5, y + 0.5));
        const double direction[3] = {d.x, d.y, d.z};
        Pixel pixel;
        if constexpr (std::is_same_v<Grid, DenseGrid>) {
          if (options.traversal == Traversal::baseline)
            pixel = follow_baseline(origin, direction, dims, cursor, colour_of, edge);
        }
        if (options.traversal != Traversal::baseline) {
          GridRay ray(origin, direction, dims);
          pixel = follow(ray, cursor, colour_of, cone, edge);
        }
        ++count.rays;
        count.rays_hit += pixel.voxel[0] >= 0;
        count.cells_visited += pixel.cells;
        frame.pixels[static_cast<size_t>(y) * static_cast<size_t>(options.width) + static_cast<size_t>(x)] =
            pixel;
      }
    count.blocks_touched = cursor.blocks();
    return cursor.status();
  }));
  frame.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  for (const Frame& count : counts) {
    frame.rays += count.rays;
    frame.rays_hit += count.rays_hit;
    frame.cells_visited += count.cells_visited;
    frame.blocks_touched += count.blocks_touched;
  }
  return frame;
}

}  // namespace

Result<std::shared_ptr<const DenseGrid>> DenseGrid::read(VolumeSource& source, Context& ctx) {
  auto grid = std::make_shared<DenseGrid>();
  grid->info_ = source.info();
  grid->bytes_ = voxel_bytes(grid->info_.format);
  const auto voxels = checked_voxels(grid->info_.dims);
  if (!voxels || *voxels > uint64_t{1} << 56)
    return fail(ErrorCode::limit, {}, "the volume is too large to render uncompressed");
  VOX_TRY(grid->buffer_, Buffer::allocate(*voxels * static_cast<uint64_t>(grid->bytes_), "the volume", ctx));
  grid->voxels_ = grid->buffer_->data();
  const VoxelSpan all = packed(grid->buffer_->data(), grid->info_.dims, grid->info_.format);
  const Slabs slabs(grid->info_.box(), grid->bytes_, slab_target(ctx));
  for (int64_t i = 0; i < slabs.count(); ++i) {
    VOX_CHECK(check_interrupt());
    const Box slab = slabs.slab(i);
    source.expect(slab.lo.z, slab.hi.z);
    VOX_CHECK(read_slab(source, slab, {all.row(0, slab.lo.z), all.row_stride, all.slice_stride}, ctx));
    source.release(slab.lo.z, slab.hi.z);
    ctx.progress(static_cast<double>(slab.hi.z) / static_cast<double>(grid->info_.dims.z));
  }
  return grid;
}

Result<Frame> cast(const DenseGrid& grid, const Camera& camera, const CastOptions& options, Context& ctx) {
  return cast_with<DenseGrid, DenseGrid::Cursor>(grid, camera, options, ctx);
}

Result<Frame> cast(const SvmmGrid& grid, const Camera& camera, const CastOptions& options, Context& ctx) {
  if (options.traversal == Traversal::baseline)
    return bad_usage("the baseline traversal steps through uncompressed volumes: expected path or restart");
  if (options.traversal == Traversal::restart)
    return cast_with<SvmmGrid, SvmmGrid::Cursor<true>>(grid, camera, options, ctx);
  return cast_with<SvmmGrid, SvmmGrid::Cursor<false>>(grid, camera, options, ctx);
}

}  // namespace voxkit::render
