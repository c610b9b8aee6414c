// Of numbers that came with weights, the one with most.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace voxkit::color {

/// Pairs of a number and a weight, the same number any number of times: that with the greatest sum of
/// weights, of several the least; 0 of none. Sorts them.
inline uint32_t heaviest(std::vector<std::pair<uint32_t, uint64_t>>& weighed) {
  std::sort(weighed.begin(), weighed.end());
  uint32_t best = 0;
  uint64_t most = 0;
  for (size_t i = 0; i < weighed.size();) {
    const uint32_t number = weighed[i].first;
    uint64_t sum = 0;
    for (; i < weighed.size() && weighed[i].first == number; ++i) sum += weighed[i].second;
    if (sum > most) best = number, most = sum;
  }
  return best;
}

}  // namespace voxkit::color
