#include "libcolor/predicted/color_steps.h"

#include <cmath>

namespace voxkit::color {
namespace {

constexpr uint32_t square(uint32_t v) {
  return v * v;
}

/// Whether every colour has a point so near. The octant of a cell between (0, 0, 0) and its centre tells of
/// all others.
bool covers(const std::array<uint32_t, 3>& steps, uint32_t most) {
  for (uint32_t r = 0; r <= steps[0]; ++r)
    for (uint32_t g = 0; g <= steps[1]; ++g)
      for (uint32_t b = 0; b <= steps[2]; ++b)
        if (std::min(square(r) + square(g) + square(b),
                     square(steps[0] - r) + square(steps[1] - g) + square(steps[2] - b)) > most)
          return false;
  return true;
}

}  // namespace

uint32_t most_squared(double threshold) {
  constexpr double furthest = 3 * 255.0 * 255.0;
  return static_cast<uint32_t>(std::floor(std::min(threshold * threshold, furthest)));
}

ColorSteps steps_for(double threshold) {
  const uint32_t most = most_squared(threshold);
  if (most == 0) return {};
  // The deepest holes of a lattice of equal steps s are at a distance of s * sqrt(5) / 2.
  uint32_t all = 1;
  while (all < 255 && 5 * square(all + 1) <= 4 * most) ++all;
  std::array<uint32_t, 3> best{all, all, all};
  // Colours are whole numbers, so one more may do; for large steps it does not matter.
  if (all < 32)
    for (const std::array<uint32_t, 3>& more :
         {std::array{0u, 0u, 1u}, std::array{0u, 1u, 1u}, std::array{1u, 1u, 1u}}) {
      const std::array<uint32_t, 3> steps{all + more[0], all + more[1], all + more[2]};
      if (covers(steps, most)) best = steps;
    }
  return {{static_cast<uint8_t>(best[0]), static_cast<uint8_t>(best[1]), static_cast<uint8_t>(best[2])}};
}

}  // namespace voxkit::color
