#include "librender/cast/see_through.h"

#include <atomic>
#include <span>

#include "formats/clock.h"
#include "librender/cast/beam.h"
#include "librender/cast/pixel_rows.h"
#include "librender/cast/translucent_view.h"

namespace voxkit::render {
namespace {

using color::Attribute;

struct Place {
  int x, y;
};

Place place_of(size_t pixel, const Frame& frame) {
  const auto width = static_cast<size_t>(frame.width);
  return {static_cast<int>(pixel % width), static_cast<int>(pixel / width)};
}

/// Whether voxels let something through.
class Opacities {
 public:
  Opacities(const color::Volume& volume, const color::DagView& dag)
      : finder_(dag), values_(volume.store(), volume.container(), volume.params(), Attribute::opacity) {}
  /// Of a cell with colours of its own: the first voxel in it, whose number is as many steps behind the
  /// cell's.
  bool translucent(const int32_t (&voxel)[3], int height) {
    const auto found =
        finder_.find(color::morton_code(static_cast<uint32_t>(voxel[0]), static_cast<uint32_t>(voxel[1]),
                                        static_cast<uint32_t>(voxel[2])),
                     height);
    return found.there && values_.value(found.color + static_cast<uint64_t>(height)) < 255;
  }

 private:
  color::CellFinder finder_;
  color::AttributeReader values_;
};

}  // namespace

Result<std::vector<uint8_t>> see_through(const color::Volume& volume, const color::DagView& dag,
                                         const CastParams& params, Glimpse* glimpses, Frame& frame,
                                         Context& ctx) {
  const auto start = Clock::now();
  std::vector<uint8_t> pixels(frame.pixels.size());
  std::atomic<uint64_t> cells = 0;
  const TranslucentView<Search::path> view{&volume, &dag};
  struct Worker {
    Opacities opacities;
    TranslucentView<Search::path>::Cursor cursor;
  };
  VOX_CHECK(for_each_pixel(
      frame, ctx,
      [&] {
        return Worker{Opacities(volume, dag), view.cursor()};
      },
      [&](Worker& worker, size_t i) {
        if (frame.details[i].voxel[0] < 0) return;
        bool translucent = false;
        if (glimpses == nullptr) {
          translucent = worker.opacities.translucent(frame.details[i].voxel, 0);
        } else {
          const std::span<Glimpse> own(glimpses + i * Beam::most_cells, Beam::most_cells);
          for (const Glimpse& glimpse : own) {
            if (translucent || glimpse.ninths == 0) break;
            translucent = worker.opacities.translucent(glimpse.voxel, glimpse.log2_edge);
          }
          if (translucent) own[0].ninths = 0;
        }
        if (!translucent) return;
        pixels[i] = 1;
        frame.pixels[i] = {};
        frame.details[i] = {};
        const auto [x, y] = place_of(i, frame);
        cast_ray(params, worker.cursor, x, y, frame.pixels[i], frame.details[i]);
        cells += frame.details[i].cells;
      }));
  frame.cells_visited += cells;
  frame.seconds += seconds_since(start);
  if (const Status status = volume.store().status(); !status) return tl::unexpected<Error>(status.error());
  return pixels;
}

Status shine_through(const color::Volume& volume, const color::DagView& dag, const CastParams& params,
                     const std::vector<uint8_t>& pixels, Frame& frame, Context& ctx) {
  if (!frame.has.has(Attribute::emissive)) return {};
  const auto start = Clock::now();
  const TranslucentView<Search::path> view{&volume, &dag, true};
  VOX_CHECK(for_each_pixel(
      frame, ctx, [&] { return view.cursor(); },
      [&](auto& cursor, size_t i) {
        if (pixels[i] == 0) return;
        Pixel light;
        PixelDetail detail;
        const auto [x, y] = place_of(i, frame);
        cast_ray(params, cursor, x, y, light, detail);
        for (int k = 0; k < 3; ++k) frame.traits[i].emissive[k] = light.color[k];
      }));
  frame.seconds += seconds_since(start);
  return volume.store().status();
}

}  // namespace voxkit::render
