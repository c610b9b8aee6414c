// Casting on the host: tiles of pixels, spread over threads.
#include "librender/cast/ray_cast.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>

#include "formats/parallel.h"
#include "libcolor/store.h"
#include "librender/cast/cast_params.h"
#include "librender/cast/surface_colors.h"
#include "librender/cast/void_boxes.h"

namespace voxkit::render {
namespace {

constexpr int tile_width = 128, tile_height = 32;  // pixels of a task
constexpr int square = 16;                         // pixels that are drawn by packets or one by one

struct Counts {
  uint64_t hit = 0, cells = 0, blocks = 0, bytes = 0;
};
struct Rect {
  int x0, y0, x1, y1;
};

/// A block of pixels, of which (x, y) is the first, each given to `keep`.
template <int width, int height, class Cursor, class Keep>
[[gnu::always_inline]] inline void cast_packet(const CastParams& params, const Mirror& mirror, Cursor& cursor,
                                               VoidTrail& trail, int x, int y, const Keep& keep) {
  RayPacket<width, height> rays(params, mirror, x, y);
  trail.follow(rays);
  for (int i = 0; i < width * height; ++i) {
    const int pixel_x = x + i % width, pixel_y = y + i / width;
    Pixel pixel;
    PixelDetail detail;
    if (!rays.entered(i)) {
      cast_ray(params, cursor, pixel_x, pixel_y, pixel, detail);
      keep(pixel_x, pixel_y, pixel, detail);
      continue;
    }
    const BoxedCell* cell = nullptr;
    uint32_t voxel[3] = {};
    while (rays.moving(i)) {
      for (int a = 0; a < 3; ++a) voxel[a] = mirror.voxel(a, rays.voxel(i, a));
      cell = &cursor.locate(voxel[0], voxel[1], voxel[2], -1);
      if (!cell->is_void) break;
      const Mirror::Box box = mirror(cell->box.lo, cell->box.hi);
      trail.add(box);
      rays.leave(box);
    }
    detail.cells = rays.passed(i);
    if (!rays.gone(i)) {
      if (rays.moving(i) && cell->colour.alpha >= 1) {
        ++detail.cells;
        found(voxel, rays.t(i) * world_length(params, pixel_x, pixel_y), pixel, detail);
        blend(cell->colour, 0, pixel);
      } else {  // through what is translucent, or where doubles do not suffice
        for (int a = 0; a < 3; ++a) voxel[a] = mirror.voxel(a, rays.voxel(i, a));
        GridRay ray(params.start, ray_through(params, pixel_x, pixel_y).direction);
        ray.resume(rays.t(i), voxel);
        follow(params, ray, cursor, pixel_x, pixel_y, pixel, detail);
      }
    }
    keep(pixel_x, pixel_y, pixel, detail);
  }
}

template <class View>
constexpr bool has_boxes = false;
template <class Space>
constexpr bool has_boxes<BoxedView<Space>> = true;

/// The pixels of a tile: a cursor goes on where the last ray ended. `details` may be null. Packets are 2 x
/// `packet_height` pixels.
template <int packet_height, class View>
[[gnu::always_inline]] inline void cast_tile(const CastParams& params, const View& view, const Rect& tile,
                                             Pixel* pixels, PixelDetail* details, Counts& count) {
  auto cursor = view.cursor();

  Counts counted;  // here, not where tiles beside this one are counted by other threads
  const auto keep = [&](int x, int y, const Pixel& pixel, const PixelDetail& detail) {
    const int64_t i = static_cast<int64_t>(y) * params.width + x;
    pixels[i] = pixel;
    counted.hit += detail.voxel[0] >= 0;
    counted.cells += detail.cells;
    if (details != nullptr) details[i] = detail;
  };
  const auto blank = [&](int x0, int x1, int y0, int y1) {
    for (int y = y0; y < y1; ++y)
      for (int x = x0; x < x1; ++x) keep(x, y, {}, {});
  };
  const auto cast_one_by_one = [&](int x0, int x1, int y0, int y1) {
    for (int y = y0; y < y1; ++y)
      for (int x = x0; x < x1; ++x) {
        Pixel pixel;
        PixelDetail detail;
        cast_ray(params, cursor, x, y, pixel, detail);
        keep(x, y, pixel, detail);
      }
  };
  // Of the tile, only left .. right and top .. bottom may see something.
  const int left = std::clamp(params.left, tile.x0, tile.x1), right = std::clamp(params.right, left, tile.x1),
            top = std::clamp(params.top, tile.y0, tile.y1), bottom = std::clamp(params.bottom, top, tile.y1);
  blank(tile.x0, tile.x1, tile.y0, top);
  blank(tile.x0, left, top, bottom);
  blank(right, tile.x1, top, bottom);
  blank(tile.x0, tile.x1, bottom, tile.y1);
  if constexpr (has_boxes<View>) {
    for (int y = top; y < bottom; y += square)
      for (int x = left; x < right; x += square) {
        const int x_end = std::min(x + square, right), y_end = std::min(y + square, bottom);
        const Mirrored first(ray_through(params, x, y).direction);
        bool alike = true;
        for (const int at_y : {y, y_end - 1})
          for (const int at_x : {x, x_end - 1})
            alike &= first == Mirrored(ray_through(params, at_x, at_y).direction);
        if (!alike) {
          cast_one_by_one(x, x_end, y, y_end);
          continue;
        }
        const Mirror mirror(params, first);
        VoidTrail trail;
        const int whole_x = x_end - (x_end - x) % 2, whole_y = y_end - (y_end - y) % packet_height;
        for (int packet_y = y; packet_y < whole_y; packet_y += packet_height)
          for (int packet_x = x; packet_x < whole_x; packet_x += 2)
            cast_packet<2, packet_height>(params, mirror, cursor, trail, packet_x, packet_y, keep);
        cast_one_by_one(whole_x, x_end, y, whole_y);
        cast_one_by_one(x, x_end, whole_y, y_end);
      }
  } else {
    cast_one_by_one(left, right, top, bottom);
  }
  counted.blocks = cursor.blocks();
  counted.bytes = cursor.bytes();
  count = counted;
}

// The same code for two kinds of machine: packets fill a register.
template <class View>
void cast_tile_generic(const CastParams& params, const View& view, const Rect& tile, Pixel* pixels,
                       PixelDetail* details, Counts& count) {
  cast_tile<1>(params, view, tile, pixels, details, count);
}
template <class View>
[[gnu::target("avx2,bmi,bmi2,lzcnt,popcnt,fma")]] void cast_tile_avx2(const CastParams& params,
                                                                      const View& view, const Rect& tile,
                                                                      Pixel* pixels, PixelDetail* details,
                                                                      Counts& count) {
  cast_tile<2>(params, view, tile, pixels, details, count);
}

bool has_avx2() {  // and with it lzcnt, which clang 14 cannot ask for
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2") &&
         __builtin_cpu_supports("popcnt") && __builtin_cpu_supports("fma");
}

template <class View>
Status cast_with(const View& view, const CastParams& params, const CastOptions& options, Frame& frame,
                 Context& ctx) {
  frame.width = options.width;
  frame.height = options.height;
  frame.pixels.resize(static_cast<size_t>(options.width) * static_cast<size_t>(options.height));
  frame.details.resize(options.details ? frame.pixels.size() : 0);
  const int64_t across = (options.width + tile_width - 1) / tile_width,
                down = (options.height + tile_height - 1) / tile_height;
  std::vector<Counts> counts(static_cast<size_t>(across * down));
  const auto run = options.native && has_avx2() ? cast_tile_avx2<View> : cast_tile_generic<View>;
  const auto start = std::chrono::steady_clock::now();
  VOX_CHECK(parallel_for(ctx, across * down, [&](int64_t i) -> Status {
    const int x = static_cast<int>(i % across) * tile_width, y = static_cast<int>(i / across) * tile_height;
    const Rect tile{x, y, std::min(x + tile_width, options.width), std::min(y + tile_height, options.height)};
    run(params, view, tile, frame.pixels.data(), frame.details.empty() ? nullptr : frame.details.data(),
        counts[static_cast<size_t>(i)]);
    return {};
  }));
  frame.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  frame.lookup_seconds = 0;
  frame.rays = frame.pixels.size();
  frame.rays_hit = frame.cells_visited = frame.blocks_touched = frame.bytes_touched = 0;
  for (const Counts& count : counts) {
    frame.rays_hit += count.hit;
    frame.cells_visited += count.cells;
    frame.blocks_touched += count.blocks;
    frame.bytes_touched += count.bytes;
  }
  return {};
}

/// Of the cells that are worth growing: a few voxels and a few pixels wide where the volume's middle is.
int least_log2(const VolumeInfo& info, const Camera& camera, const CastOptions& options) {
  const RayGenerator rays(camera, options.width, options.height);
  const double pixel = rays.pixel_width() * glm::length(camera.eye) / GridTransform(info).smallest_edge();
  int log2_edge = 2;
  while (log2_edge < 31 && std::ldexp(1, log2_edge) < 4 * pixel) ++log2_edge;
  return log2_edge;
}

}  // namespace

SvmmGrid::SvmmGrid(std::shared_ptr<const svmm::Volume> volume)
    : volume_(std::move(volume)), learned_(std::make_shared<LearnedVoid>()) {}
DagGrid::DagGrid(std::shared_ptr<const color::Volume> volume)
    : volume_(std::move(volume)), learned_(std::make_shared<LearnedVoid>()) {}

Status cast(const DenseGrid& grid, const Camera& camera, const CastOptions& options, Frame& frame,
            Context& ctx) {
  VOX_TRY(const CastParams params, cast_params(grid.info(), camera, options));
  return options.traversal == Traversal::baseline
             ? cast_with(BaselineView{grid.view()}, params, options, frame, ctx)
             : cast_with(grid.view(), params, options, frame, ctx);
}

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
        {view, &pools, {&params.colour_of}}, &params, memo.get(), least_log2(info, camera, options)};
    VOX_CHECK(cast_with(boxed, params, options, frame, ctx));
  }
  return grid.volume().store().status();
}

Status cast(const DagGrid& grid, const Camera& camera, const CastOptions& options, Frame& frame,
            Context& ctx) {
  if (options.traversal == Traversal::baseline) return only_dense_has_baseline();
  const color::Volume& volume = grid.volume();
  VOX_TRY(const color::DagView* const dag, volume.store().dag(volume.container(), volume.params()));
  VOX_TRY(const CastParams params, cast_params(grid.info(), camera, options));
  CastOptions detailed = options;
  detailed.details = true;  // where to look colours up
  if (options.traversal == Traversal::restart) {
    VOX_CHECK(cast_with(DagCastView<Search::restart>{dag}, params, detailed, frame, ctx));
  } else if (params.cone > 0 || !options.skip) {
    VOX_CHECK(cast_with(DagCastView<Search::path>{dag}, params, detailed, frame, ctx));
  } else {
    VOX_TRY(const std::shared_ptr<VoidMemo> memo, grid.learned().memo({}, ctx));
    const BoxedView<DagSpace> boxed{{{dag}}, &params, memo.get(), least_log2(grid.info(), camera, options)};
    VOX_CHECK(cast_with(boxed, params, detailed, frame, ctx));
  }
  VOX_CHECK(look_up_colors(volume, frame, ctx));
  if (!options.details) frame.details.clear();
  return {};
}

}  // namespace voxkit::render
