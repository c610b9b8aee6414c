// Contexts: how large residuals of neighbours in earlier rows are says how large the next may be.
#pragma once

#include <array>
#include <cstdint>

namespace voxkit::page {

/// Magnitudes of residuals are remembered up to this.
inline constexpr uint32_t most_magnitude = 255;
/// A weighted sum of magnitudes: twice those above and behind, once those beside these.
inline constexpr uint32_t most_activity = 8 * most_magnitude;
inline constexpr int activity_steps = 16;
/// Without a row above and behind; without a plane behind; without a row above; others.
inline constexpr int context_count = 1 + 3 * activity_steps;
/// The least activity of each step from the second on.
using Thresholds = std::array<uint16_t, activity_steps - 1>;
inline constexpr Thresholds default_thresholds = {1, 3, 6, 9, 13, 18, 24, 32, 44, 60, 85, 125, 190, 300, 520};

/// The context of activity 0 in row (y, z).
constexpr int first_context(int y, int z) {
  return z == 0 ? (y == 0 ? 0 : 1) : (y == 0 ? 1 + activity_steps : 1 + 2 * activity_steps);
}

}  // namespace voxkit::page
