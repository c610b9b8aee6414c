// Prediction: a weighted mean of the 13 neighbours that come before a voxel, with weights for each class of
// voxels that have the same of these in their page.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "libpage/extent.h"

namespace voxkit::page {

/// 0..8: of the plane before, row y + t / 3 - 1, voxel x + t % 3 - 1; 9..11: of the row before, voxel
/// x + t - 10; 12: the voxel before.
inline constexpr int tap_count = 13;
inline constexpr int left_tap = 12;
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
  if (tap == left_tap) return px != first;
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

/// Room for two planes: x = 0 is at `row_start` of a row; there are copies of the first and the last voxel of
/// a row on its sides.
inline constexpr int row_start = 8;
inline constexpr int row_stride = 32;
template <class Stored>
using Rows = std::array<std::array<Stored, row_stride>, max_side>;
template <class Stored>
using Planes = std::array<Rows<Stored>, 2>;

/// The rows that the taps of row (y, z) lie in. Those that are not there are others, of weight 0.
template <class Stored>
std::array<const Stored*, 4> tap_rows(const Planes<Stored>& planes, int y, int z, int ny) {
  const Rows<Stored>&before = planes[static_cast<size_t>(~z & 1)], &now = planes[static_cast<size_t>(z & 1)];
  const auto row = [](const Rows<Stored>& rows, int at) {
    return rows[static_cast<size_t>(at)].data() + row_start;
  };
  return {row(before, std::max(y - 1, 0)), row(before, y), row(before, std::min(y + 1, ny - 1)),
          row(now, std::max(y - 1, 0))};
}

}  // namespace voxkit::page
