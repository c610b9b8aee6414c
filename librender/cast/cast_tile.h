// A tile of a picture on the host, for any view: rays in packets or one by one, compiled for two kinds of
// machine. All of it is static: what each file has is its own, so compilers make one piece of it, for AVX2
// where it is for that.
#pragma once

#include <algorithm>
#include <functional>

#include "formats/cpu.h"
#include "librender/cast/cast_params.h"
#include "librender/cast/void_boxes.h"

namespace voxkit::render {

inline constexpr int square = 16;  ///< pixels that are drawn by packets or one by one

/// What the rays of a tile cost.
struct TileCounts {
  uint64_t hit = 0, cells = 0, blocks = 0, bytes = 0;
};
/// Pixels x0 <= x < x1, y0 <= y < y1.
struct TileRect {
  int x0, y0, x1, y1;
};

/// A block of pixels, of which (x, y) is the first, each given to `keep`.
template <int width, int height, class Cursor, class Keep>
[[gnu::always_inline]] static inline void cast_packet(const CastParams& params, const Mirror& mirror,
                                                      Cursor& cursor, VoidTrail& trail, int x, int y,
                                                      const Keep& keep) {
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
    constexpr bool levels = HasParts<Cursor>;
    const double cone = levels ? params.cone * world_length(params, pixel_x, pixel_y) : 0;
    const typename Cursor::Boxed* cell = nullptr;
    uint32_t voxel[3] = {};
    while (rays.moving(i)) {
      for (int a = 0; a < 3; ++a) voxel[a] = mirror.voxel(a, rays.voxel(i, a));
      cell = &cursor.locate(voxel[0], voxel[1], voxel[2], levels ? finest_parts_log2(cone * rays.t(i)) : -1);
      if (!cell->is_void_to_all()) break;
      const Mirror::Box box = mirror(cell->box.lo, cell->box.hi);
      trail.add(box);
      rays.leave(box);
    }
    detail.cells = rays.passed(i);
    if (!rays.gone(i)) {
      if (!levels && rays.moving(i) && cell->color.alpha >= 1) {
        ++detail.cells;
        found(voxel, rays.t(i) * world_length(params, pixel_x, pixel_y), pixel, detail);
        blend(cell->color, 0, pixel);
      } else {  // through what is translucent or coarse, or where doubles do not suffice
        for (int a = 0; a < 3; ++a) voxel[a] = mirror.voxel(a, rays.voxel(i, a));
        GridRay ray(params.start, ray_through(params, pixel_x, pixel_y).direction);
        ray.resume(rays.t(i), voxel);
        if constexpr (levels)
          follow_levels(params, ray, cursor, pixel_x, pixel_y, pixel, detail);
        else
          follow(params, ray, cursor, pixel_x, pixel_y, pixel, detail);
      }
    }
    keep(pixel_x, pixel_y, pixel, detail);
  }
}

template <class View>
inline constexpr bool has_boxes = false;
template <class Space, bool levels>
inline constexpr bool has_boxes<BoxedView<Space, levels>> = true;

/// The pixels of a tile: a cursor goes on where the last ray ended. `details` may be null. Packets are 2 x
/// `packet_height` pixels.
template <int packet_height, class View>
[[gnu::always_inline]] static inline void cast_tile(const CastParams& params, const View& view,
                                                    const TileRect& tile, Pixel* pixels, PixelDetail* details,
                                                    TileCounts& count) {
  auto cursor = view.cursor();

  TileCounts counted;  // here, not where tiles beside this one are counted by other threads
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
static void cast_tile_generic(const CastParams& params, const View& view, const TileRect& tile, Pixel* pixels,
                              PixelDetail* details, TileCounts& count) {
  cast_tile<1>(params, view, tile, pixels, details, count);
}
#ifdef VOXKIT_AVX2
template <class View>
VOXKIT_AVX2_CODE static void cast_tile_avx2(const CastParams& params, const View& view, const TileRect& tile,
                                            Pixel* pixels, PixelDetail* details, TileCounts& count) {
  cast_tile<2>(params, view, tile, pixels, details, count);
}
#endif

/// What fills the pixels and details of a tile; details may be null.
using CastTile = std::function<void(const TileRect&, Pixel*, PixelDetail*, TileCounts&)>;
/// Begins a frame and fills it, tiles spread over threads. Errors: those of Frame::begin and of interrupts.
Status cast_tiles(const CastTile& cast_tile, const CastOptions& options, Frame& frame, Context& ctx);

/// A picture of a view.
template <class View>
static Status cast_with(const View& view, const CastParams& params, const CastOptions& options, Frame& frame,
                        Context& ctx) {
  auto* tile = cast_tile_generic<View>;
#ifdef VOXKIT_AVX2
  if (options.native && has_avx2()) tile = cast_tile_avx2<View>;
#endif
  return cast_tiles([&, tile](const TileRect& rect, Pixel* pixels, PixelDetail* details,
                              TileCounts& count) { tile(params, view, rect, pixels, details, count); },
                    options, frame, ctx);
}

/// log2 of the least edge of void cells that are worth growing: a few voxels and a few pixels wide where the
/// volume's middle is.
int least_log2(const VolumeInfo& info, const Camera& camera, const CastOptions& options);

}  // namespace voxkit::render
