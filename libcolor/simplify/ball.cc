#include "libcolor/simplify/ball.h"

#include <algorithm>
#include <cmath>

namespace voxkit::color {

std::vector<Step> ball(int squared) {
  std::vector<Step> steps;
  for (int z = -most_simplify; z <= most_simplify; ++z)
    for (int y = -most_simplify; y <= most_simplify; ++y)
      for (int x = -most_simplify; x <= most_simplify; ++x)
        if (const int length = x * x + y * y + z * z; length <= squared)
          steps.push_back({static_cast<int8_t>(x), static_cast<int8_t>(y), static_cast<int8_t>(z),
                           static_cast<uint8_t>(length)});
  std::stable_sort(steps.begin(), steps.end(),
                   [](const Step& a, const Step& b) { return a.squared < b.squared; });
  return steps;
}

int squared_of(double distance) {
  int squared = 0;
  while (squared < most_simplify * most_simplify && std::sqrt(squared + 1.0) <= distance) ++squared;
  return squared;
}

}  // namespace voxkit::color
