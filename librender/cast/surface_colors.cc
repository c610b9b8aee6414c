#include "librender/cast/surface_colors.h"

#include <algorithm>

#include "formats/clock.h"
#include "libcolor/store.h"
#include "libcolor/surface/morton.h"
#include "librender/cast/beam.h"
#include "librender/cast/pixel_rows.h"

namespace voxkit::render {

Status look_up_colors(const color::Volume& volume, const Glimpse* glimpses, Frame& frame, Context& ctx) {
  const auto start = Clock::now();
  const ColorOf color_of(VoxelFormat::rgba32, {});
  VOX_TRY(const color::DagView* const dag, volume.store().dag(volume.container(), volume.params()));
  struct Worker {
    color::ColorReader reader;
    color::CellFinder finder;
  };
  const auto make = [&] {
    return Worker{color::ColorReader(volume.store(), volume.container(), volume.params()),
                  color::CellFinder(*dag)};
  };
  VOX_CHECK(for_each_pixel(frame, ctx, make, [&](Worker& worker, size_t i) {
    const auto look_up = [&](const int32_t(&voxel)[3], int height) {
      const uint64_t place = color::morton_code(
          static_cast<uint32_t>(voxel[0]), static_cast<uint32_t>(voxel[1]), static_cast<uint32_t>(voxel[2]));
      const color::Rgb c = worker.reader.color(worker.finder.find(place, height).color);
      return color_of(Voxel::of(static_cast<uint32_t>(c.r | c.g << 8 | c.b << 16) | 0xff000000u));
    };
    const int32_t(&voxel)[3] = frame.details[i].voxel;
    if (voxel[0] < 0) return;
    float(&pixel)[4] = frame.pixels[i].color;
    if (glimpses == nullptr) {
      const Color seen = look_up(voxel, 0);
      for (int k = 0; k < 3; ++k) pixel[k] = seen.rgb[k];
      return;
    }
    const Glimpse* glimpse = glimpses + i * Beam::most_cells;
    for (int n = 0; n < Beam::most_cells && glimpse->ninths > 0; ++n, ++glimpse) {
      const Color seen = look_up(glimpse->voxel, std::min<int>(glimpse->log2_edge, dag->height));
      const float share = static_cast<float>(glimpse->ninths) * (1.0f / 9);
      for (int k = 0; k < 3; ++k) pixel[k] += share * seen.rgb[k];
    }
  }));
  const double seconds = seconds_since(start);
  frame.lookup_seconds += seconds;
  frame.seconds += seconds;
  return volume.store().status();
}

}  // namespace voxkit::render
