#include "librender/cast/see_through.h"

#include <algorithm>
#include <atomic>
#include <span>

#include "formats/clock.h"
#include "formats/parallel.h"
#include "librender/cast/beam.h"
#include "librender/cast/translucent_view.h"

namespace voxkit::render {
namespace {

using color::Attribute;

/// Calls `visit`, with a worker that `make` makes for each thread's rows, for each pixel.
template <class Make, class Visit>
Status for_each_pixel(const Frame& frame, Context& ctx, const Make& make, const Visit& visit) {
  constexpr int rows = 16;
  return parallel_for(ctx, (frame.height + rows - 1) / rows, [&](int64_t task) -> Status {
    auto worker = make();
    const int first = static_cast<int>(task) * rows, last = std::min(first + rows, frame.height);
    for (int y = first; y < last; ++y)
      for (int x = 0; x < frame.width; ++x)
        visit(worker, x, y,
              static_cast<size_t>(y) * static_cast<size_t>(frame.width) + static_cast<size_t>(x));
    return {};
  });
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
      [&](Worker& worker, int x, int y, size_t i) {
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
      [&](auto& cursor, int x, int y, size_t i) {
        if (pixels[i] == 0) return;
        Pixel light;
        PixelDetail detail;
        cast_ray(params, cursor, x, y, light, detail);
        for (int k = 0; k < 3; ++k) frame.traits[i].emissive[k] = light.color[k];
      }));
  frame.seconds += seconds_since(start);
  return volume.store().status();
}

}  // namespace voxkit::render
