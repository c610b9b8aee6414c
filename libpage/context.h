// Contexts: how large the residuals of neighbours are, and how far neighbours are apart, says how large the
// next residual may be.
#pragma once

#include <array>
#include <cstdint>

namespace voxkit::page {

/// Magnitudes of residuals are remembered up to this.
inline constexpr uint32_t most_magnitude = 255;
inline constexpr int activity_steps = 24;
/// In the first plane; in the first row of others; in other rows. With parents: of each of the 8 children.
inline constexpr int context_count(bool parents) {
  return (parents ? 8 : 3) * activity_steps;
}
inline constexpr int most_contexts = context_count(true);
/// The least activity of each step from the second on.
inline constexpr std::array<uint16_t, activity_steps - 1> thresholds = {
    1, 2, 3, 4, 5, 6, 7, 8, 11, 15, 20, 27, 37, 49, 67, 90, 122, 164, 222, 299, 404, 546, 737};

/// Activity of what lies in earlier rows: twice the magnitudes above and behind, once those beside these, and
/// half the range of the twelve samples around in steps of the quantiser; at most this. The voxel before adds
/// twice its own magnitude.
inline constexpr int most_row_activity = thresholds.back();
inline constexpr uint32_t left_share = 2;
inline constexpr uint32_t most_activity = most_row_activity + left_share * most_magnitude;

/// The step of an activity, times a factor.
template <uint16_t factor>
inline constexpr std::array<uint16_t, most_activity + 1> step_of_activity = [] {
  std::array<uint16_t, most_activity + 1> steps{};
  size_t next = 0;
  for (uint32_t activity = 0; activity <= most_activity; ++activity) {
    while (next < thresholds.size() && activity >= thresholds[next]) ++next;
    steps[activity] = static_cast<uint16_t>(next * factor);
  }
  return steps;
}();

/// The context of activity 0 in row (y, z).
constexpr uint32_t first_context(int y, int z) {
  return static_cast<uint32_t>((z == 0 ? 0 : y == 0 ? 1 : 2) * activity_steps);
}

}  // namespace voxkit::page
