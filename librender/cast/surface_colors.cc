#include "librender/cast/surface_colors.h"

#include <algorithm>

#include "formats/clock.h"
#include "formats/parallel.h"
#include "libcolor/store.h"
#include "libcolor/surface/morton.h"

namespace voxkit::render {

Status look_up_colors(const color::Volume& volume, Frame& frame, Context& ctx) {
  const auto start = Clock::now();
  VOX_TRY(const color::DagView* const dag, volume.store().dag(volume.container(), volume.params()));
  constexpr int64_t rows = 16;  // row by row: neighbours are mostly in one block
  VOX_CHECK(parallel_for(ctx, (frame.height + rows - 1) / rows, [&](int64_t task) -> Status {
    color::ColorReader reader(volume.store(), volume.container(), volume.params());
    color::CellFinder finder(*dag);
    const int64_t width = frame.width, first = task * rows * width,
                  last = std::min<int64_t>((task + 1) * rows, frame.height) * width;
    for (int64_t i = first; i < last; ++i) {
      const int32_t(&voxel)[3] = frame.details[static_cast<size_t>(i)].voxel;
      if (voxel[0] < 0) continue;
      const uint64_t place = color::morton_code(
          static_cast<uint32_t>(voxel[0]), static_cast<uint32_t>(voxel[1]), static_cast<uint32_t>(voxel[2]));
      float(&pixel)[4] = frame.pixels[static_cast<size_t>(i)].color;
      const auto height = static_cast<int>(pixel[0] * 255 + 0.5f);  // of the cell, see DagCastView
      const color::Rgb c = reader.color(finder.find(place, height).color);
      const Color seen = ColorOf(VoxelFormat::rgba32, {})(
          Voxel::of(static_cast<uint32_t>(c.r | c.g << 8 | c.b << 16) | 0xff000000u));
      for (int k = 0; k < 3; ++k) pixel[k] = seen.rgb[k];
    }
    return {};
  }));
  const double seconds = seconds_since(start);
  frame.lookup_seconds += seconds;
  frame.seconds += seconds;
  return volume.store().status();
}

}  // namespace voxkit::render
