// Prediction: a weighted mean of the 16 neighbours that come before a voxel, and of 14 voxels of the coarser
// level where that is known, with weights for each class of voxels that have the same of these in their page.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "libpage/extent.h"

namespace voxkit::page {

/// 0..8: of the plane before, row y + t / 3 - 1, voxel x + t % 3 - 1; 9..11: of the row before, voxel
/// x + t - 10; 12: the voxel before; 13, 14, 15: the second before, above and behind, or where that is
/// outside the page, the first.
inline constexpr int causal_taps = 16;
inline constexpr int left_tap = 12, second_left_tap = 13, second_above_tap = 14, second_behind_tap = 15;
/// Of models with parents, 17: the parent, which is the voxel of the coarser level that stands for the voxel
/// and those beside it; 16 and 18: before and behind that along x; 19..21, 22..24, 25..27: the same next to
/// these, on the voxel's side, along y, z, both; 28, 29: next to the parent on the other side along y, z.
/// Where that is outside the page of parents, the nearest inside.
inline constexpr int parent_tap = 16;
inline constexpr int tap_count = 30;
inline constexpr int taps_of(bool parents) {
  return parents ? tap_count : causal_taps;
}
/// Taps that are known before the first voxel of a row: all but the two before a voxel.
inline constexpr int row_taps(bool parents) {
  return taps_of(parents) - 2;
}
/// Of these, the number of tap i.
inline constexpr size_t row_tap(size_t i) {
  return i < static_cast<size_t>(left_tap) ? i : i + 2;
}
inline constexpr int weight_bits = 12;
/// The sum of the weights of a class, so that what is uniform is predicted as it is.
inline constexpr int32_t weight_one = 1 << weight_bits;
/// The sum of their magnitudes is at most this: 16-bit samples keep 32-bit sums.
inline constexpr int32_t most_weight = 65535;

/// Where along an axis of the page a voxel is. The first of one is first.
enum : int { first = 0, inner = 1, last = 2 };
constexpr int place(int at, int n) {
  return at == 0 ? first : at == n - 1 ? last : inner;
}
/// Classes of voxels of a model, without or with parents. Which of its parent's children a voxel is matters
/// as much as what it is next to: of the last one little is unknown.
struct Classes {
  bool parents = false;
  constexpr int count() const { return parents ? 48 : 18; }
  /// Along x or y: the first, the last, or which of two children one between them is.
  constexpr int along(int at, int n) const {
    if (!parents) return place(at, n);
    return at == 0 ? 0 : at == n - 1 ? 3 : 1 + (at & 1);
  }
  /// Of voxels that are `px` and `py` along x and y, in plane z.
  constexpr int of(int px, int py, int z) const {
    if (!parents) return (z > 0 ? 9 : 0) + 3 * py + px;
    return ((z == 0 ? 0 : 1 + (z & 1)) * 4 + py) * 4 + px;
  }
  /// Whether voxels of a class have a tap within the page.
  constexpr bool has(int voxel_class, int tap) const {
    const int sides = parents ? 4 : 3, end = sides - 1;
    const int px = voxel_class % sides, py = voxel_class / sides % sides;
    const bool behind = voxel_class >= sides * sides;
    if (tap >= parent_tap) return parents;
    if (tap == left_tap || tap == second_left_tap) return px != 0;
    if (tap == second_above_tap) return py != 0;
    if (tap == second_behind_tap) return behind;
    const int dx = tap % 3 - 1, dy = tap < 9 ? tap / 3 - 1 : -1;
    return (behind || tap >= 9) && (dx >= 0 || px != 0) && (dx <= 0 || px != end) && (dy >= 0 || py != 0) &&
           (dy <= 0 || py != end);
  }
  /// The tap whose weight is what the others leave of `weight_one`: the parent, or else the nearest behind,
  /// above, or before; -1: this class has none, and is predicted as the model's background.
  constexpr int rest(int voxel_class) const {
    for (const int tap : {parent_tap + 1, 4, 10, left_tap})
      if (has(voxel_class, tap)) return tap;
    return -1;
  }
};
inline constexpr int most_classes = Classes{true}.count();

using Weights = std::array<int16_t, tap_count>;

/// Room for the plane and those before: plane z is at z % 4, x = 0 at `row_start` of a row. There are copies
/// of the first and the last voxel of a row on its sides.
inline constexpr int row_start = 8;
inline constexpr int row_stride = 32;
template <class Stored>
using Planes = std::array<std::array<std::array<Stored, row_stride>, max_side>, 4>;
template <class Stored>
[[gnu::always_inline]] inline Stored* row_of(Planes<Stored>& planes, int y, int z) {
  return planes[static_cast<size_t>(z & 3)][static_cast<size_t>(y)].data() + row_start;
}
template <class Stored>
[[gnu::always_inline]] inline const Stored* row_of(const Planes<Stored>& planes, int y, int z) {
  return planes[static_cast<size_t>(z & 3)][static_cast<size_t>(y)].data() + row_start;
}

/// The rows that the taps of row (y, z) lie in, but for those of the row itself: taps t < 12 in rows[t / 3],
/// then the second above and the second behind. In place of rows outside the page there are the nearest of
/// the same plane, or else of the other one; the first row of all has none.
template <class Stored>
[[gnu::always_inline]] inline std::array<const Stored*, 6> tap_rows(const Planes<Stored>& planes, int y,
                                                                    int z, int ny) {
  const int up = std::max(y - 1, 0), behind = std::max(z - 1, 0);
  const Stored* above = y > 0 ? row_of(planes, y - 1, z) : row_of(planes, y, behind);
  if (z == 0) return {above, above, above, above, row_of(planes, std::max(y - 2, 0), z), above};
  return {row_of(planes, up, behind),
          row_of(planes, y, behind),
          row_of(planes, std::min(y + 1, ny - 1), behind),
          above,
          y > 0 ? row_of(planes, std::max(y - 2, 0), z) : above,
          row_of(planes, y, std::max(z - 2, 0))};
}

}  // namespace voxkit::page
