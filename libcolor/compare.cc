#include "libcolor/compare.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "formats/lab.h"
#include "libcolor/store.h"

namespace voxkit::color {

namespace {

Lab lab_of(Rgb c) {
  return lab_of_linear(srgb_to_linear(c.r / 255.0), srgb_to_linear(c.g / 255.0), srgb_to_linear(c.b / 255.0));
}

}  // namespace

Result<SurfaceDiff> compare(SurfaceSource& source, const Volume& volume, Context& ctx) {
  VOX_TRY(const DagView* const view, volume.store().dag(volume.container(), volume.params()));
  ColorReader reader(volume.store(), volume.container(), volume.params());
  CellFinder finder(*view);
  SurfaceDiff diff;
  const bool lab = volume.params().space == ErrorSpace::lab;
  uint64_t squares = 0;
  double furthest_lab = 0;
  int64_t furthest = 0, furthest_channel = 0;
  const uint64_t end = uint64_t{1} << 3 * volume.params().height;
  VOX_CHECK(source.read(ctx, [&](std::span<const SurfaceVoxel> run) -> Status {
    VOX_CHECK(check_interrupt());
    diff.voxels += run.size();
    for (const SurfaceVoxel& voxel : run) {
      const Found found = voxel.place < end ? finder.find(voxel.place, 0) : Found{};
      if (!found.there) {
        diff.same_voxels = false;
        continue;
      }
      const Rgb color = reader.color(found.color);
      const std::array<int64_t, 3> apart = {color.r - voxel.color.r, color.g - voxel.color.g,
                                            color.b - voxel.color.b};
      int64_t distance = 0;
      for (const int64_t d : apart) {
        distance += d * d;
        furthest_channel = std::max<int64_t>(furthest_channel, std::abs(d));
      }
      squares += static_cast<uint64_t>(distance);
      furthest = std::max(furthest, distance);
      if (lab && distance > 0)
        furthest_lab = std::max(furthest_lab, delta_e(lab_of(color), lab_of(voxel.color)));
    }
    return volume.store().status();
  }));
  // No place comes twice, so those that were found are all that there are.
  diff.same_voxels &= diff.voxels == volume.params().leaf_voxels;
  const double samples = 3 * static_cast<double>(std::max<uint64_t>(diff.voxels, 1));
  const double mse = static_cast<double>(squares) / samples;
  diff.rmse = std::sqrt(mse);
  diff.psnr_db = 10 * std::log10(255.0 * 255.0 / mse);
  diff.max_abs_error = static_cast<double>(furthest_channel);
  diff.max_distance = lab ? furthest_lab : std::sqrt(static_cast<double>(furthest));
  return diff;
}

}  // namespace voxkit::color
