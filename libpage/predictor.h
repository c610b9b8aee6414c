// Prediction: a weighted mean of the 16 neighbours that come before a voxel, with weights for each class of
// voxels that have the same of these in their page.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "libpage/extent.h"

namespace voxkit::page {

/// 0..8: of the plane before, row y + t / 3 - 1, voxel x + t % 3 - 1; 9..11: of the row before, voxel
/// x + t - 10; 12: the voxel before; 13, 14, 15: the second before, above and behind, or where that is
/// outside the page, the first.
inline constexpr int tap_count = 16;
inline constexpr int left_tap = 12, second_left_tap = 13, second_above_tap = 14, second_behind_tap = 15;
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
inline constexpr int class_count = 18;
/// `place` along x and y, and whether there is a plane before.
constexpr int class_of(int px, int py, bool behind) {
  return (behind ? 9 : 0) + 3 * py + px;
}
/// Whether voxels of a class have a tap within the page.
constexpr bool has_tap(int voxel_class, int tap) {
  const int px = voxel_class % 3, py = voxel_class / 3 % 3;
  const bool behind = voxel_class >= 9;
  if (tap == left_tap || tap == second_left_tap) return px != first;
  if (tap == second_above_tap) return py != first;
  if (tap == second_behind_tap) return behind;
  const int dx = tap % 3 - 1, dy = tap < 9 ? tap / 3 - 1 : -1;
  return (behind || tap >= 9) && (dx >= 0 || px != first) && (dx <= 0 || px != last) &&
         (dy >= 0 || py != first) && (dy <= 0 || py != last);
}
/// The tap whose weight is what the others leave of `weight_one`: the nearest behind, else above, else
/// before; -1: this class has none, and is predicted as the model's background.
constexpr int rest_tap(int voxel_class) {
  for (const int tap : {4, 10, left_tap})
    if (has_tap(voxel_class, tap)) return tap;
  return -1;
}

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
