// Asking something of all voxels of a box, without decoding what one answer settles.
#pragma once

#include <algorithm>

#include "libsvmm/walk.h"

namespace voxkit::svmm {

/// Whether `is(value)` holds for every voxel lo <= v < hi, a box inside the volume. Looks at `budget`
/// terminal voxels at most, which it counts down; false where these do not suffice or a block is missing.
template <class Pools, class Is>
class EveryVoxel {
 public:
  EveryVoxel(const View& view, const Pools& pools, const Is& is, int budget)
      : view_(view), pools_(pools), is_(is), budget_(budget) {}

  bool operator()(const uint32_t (&lo)[3], const uint32_t (&hi)[3]) {
    found_ = false;
    return inside(view_.root, pools_.block(view_.root, 0), lo, hi, {});
  }
  int budget() const { return budget_; }
  /// Of a box for which it does not hold: whether that is since a terminal voxel was found for which it does
  /// not, and where along an axis that voxel lies, begin <= v < end.
  bool found() const { return found_; }
  uint64_t begin(int axis) const { return uint64_t{at_[axis]} << shift_; }
  uint64_t end(int axis) const { return (uint64_t{at_[axis]} + 1) << shift_; }

 private:
  bool inside(int k, const std::byte* block, const uint32_t (&lo)[3], const uint32_t (&hi)[3],
              const Voxel& parent) {
    if (block == nullptr) return false;
    const LevelView& level = view_.levels[k];
    const StructuralBlock here{block, level.size, view_.format, view_.layout};
    uint32_t first[3], last[3];
    for (int a = 0; a < 3; ++a) first[a] = lo[a] >> level.shift, last[a] = (hi[a] - 1) >> level.shift;
    for (uint32_t z = first[2]; z <= last[2]; ++z)
      for (uint32_t y = first[1]; y <= last[1]; ++y)
        for (uint32_t x = first[0]; x <= last[0]; ++x) {
          if (--budget_ < 0) return false;
          const Index3 v(x & level.within, y & level.within, z & level.within);
          if (k == 0) {
            if (!is_(base_voxel(block, v, parent))) return found({x, y, z}, level.shift);
            continue;
          }
          const int64_t index = voxel_index(v, level.size);
          const Link link = here.link(index / 8);
          const Voxel value = here.value(index);
          const int i = static_cast<int>(index % 8);
          if (!(link.mask >> i & 1u)) {
            if (!is_(decoded_value(value, view_.format))) return found({x, y, z}, level.shift);
            continue;
          }
          const uint32_t at[3] = {x, y, z};
          uint32_t from[3], to[3];

          for (int a = 0; a < 3; ++a) {
            const uint64_t first_voxel = uint64_t{at[a]} << level.shift;
            from[a] = static_cast<uint32_t>(std::max<uint64_t>(lo[a], first_voxel));
            to[a] =
                static_cast<uint32_t>(std::min<uint64_t>(hi[a], first_voxel + (uint64_t{1} << level.shift)));
          }

          if (!inside(k - 1, pools_.block(k - 1, link.child(i)), from, to, value)) return false;
        }
    return true;
  }

  bool found(const uint32_t (&at)[3], int shift) {
    for (int a = 0; a < 3; ++a) at_[a] = at[a];
    shift_ = shift;
    found_ = true;
    return false;
  }
  Voxel base_voxel(const std::byte* block, Index3 v, const Voxel& parent) const {
    const LevelView& level = view_.levels[0];
    if (view_.base == Base::raw && view_.layout == Layout::plain && view_.format == VoxelFormat::rgba32)
      return Voxel::of(load_le<uint32_t>(block + voxel_index(v, level.size) * 4));
    return decode_base_voxel(block, level.size, v, view_.format, view_.base, view_.layout, parent);
  }

  const View& view_;
  const Pools& pools_;
  const Is& is_;
  int budget_;
  bool found_ = false;
  uint32_t at_[3] = {};
  int shift_ = 0;
};

}  // namespace voxkit::svmm
