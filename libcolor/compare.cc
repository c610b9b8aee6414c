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

/// The values of voxels that are in both.
class Attributes {
 public:
  Attributes(AttributeSet set, const Volume& volume, SurfaceDiff& diff) : set_(set), diff_(diff) {
    diff.same_attributes = set == volume.params().attributes;
    for (const AttributeParams& params : volume.attributes()) {
      if (!set.has(params.attribute)) continue;
      diff.attributes.push_back({params.attribute, 0, 0});
      columns_.push_back(
          {params, AttributeReader(volume.store(), volume.container(), volume.params(), params.attribute)});
    }
  }
  void compare(const VoxelRun& run, size_t i, uint64_t index) {
    for (size_t c = 0; c < columns_.size(); ++c) {
      const AttributeParams& params = columns_[c].params;
      const std::byte* const bytes = &run.attributes[i * set_.bytes() + set_.offset(params.attribute)];
      const uint32_t was = value_at(bytes, kind_of(params.attribute).bytes);
      const uint32_t is = columns_[c].reader.value(index);
      if (was == is) continue;
      AttributeDiff& diff = diff_.attributes[c];
      ++diff.differing;
      diff.most_error = std::max(diff.most_error, attribute_error(params.attribute, params.space, was, is));
    }
  }

 private:
  struct Column {
    AttributeParams params;
    AttributeReader reader;
  };
  AttributeSet set_;
  SurfaceDiff& diff_;
  std::vector<Column> columns_;
};

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
  Attributes attributes(source.attributes(), volume, diff);
  VOX_CHECK(source.read(ctx, [&](const VoxelRun& run) -> Status {
    VOX_CHECK(check_interrupt());
    diff.voxels += run.voxels.size();
    for (size_t i = 0; i < run.voxels.size(); ++i) {
      const SurfaceVoxel& voxel = run.voxels[i];
      const Found found = voxel.place < end ? finder.find(voxel.place, 0) : Found{};
      if (!found.there) {
        diff.same_voxels = false;
        continue;
      }
      attributes.compare(run, i, found.color);
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
