// Pages to try: noise, ramps, edges, few values, extremes.
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "libpage/extent.h"

namespace voxkit::page::test {

inline constexpr int page_kinds = 9;
inline constexpr Extent extents[] = {{16, 16, 16}, {8, 8, 8},  {1, 1, 1}, {1, 1, 16},
                                     {1, 16, 1},   {16, 1, 1}, {2, 2, 2}, {16, 2, 16},
                                     {3, 16, 5},   {15, 7, 1}, {1, 5, 9}, {2, 1, 16}};

/// Samples of 0..greatest.
inline std::vector<uint32_t> make_page(int kind, Extent e, uint32_t greatest, std::mt19937& random) {
  std::vector<uint32_t> samples;
  const auto any = [&] { return static_cast<int64_t>(random() % (uint64_t{greatest} + 1)); };
  const int64_t base = any(), other = any(), noise = 1 + static_cast<int64_t>(random() % (greatest / 16 + 2));
  const int64_t dx = any() / 32 - int64_t{greatest} / 64, dy = any() / 32 - int64_t{greatest} / 64,
                dz = any() / 32 - int64_t{greatest} / 64;
  for (int z = 0; z < e.nz; ++z)
    for (int y = 0; y < e.ny; ++y)
      for (int x = 0; x < e.nx; ++x) {
        const int64_t jitter = static_cast<int64_t>(random() % static_cast<uint64_t>(noise)) - noise / 2;
        int64_t value = base;
        switch (kind) {
          case 0:
            value = any();
            break;
          case 1:
            value = base + x * dx + y * dy + z * dz;
            break;
          case 2:
            value = base + x * dx + y * dy + z * dz + jitter;
            break;
          case 3:
            value = x + y + z < 20 ? 0 : greatest;
            break;
          case 4:
            value = random() % 2 != 0 ? 0 : greatest;
            break;
          case 5:
            value = random() % 400 == 0 ? other : base;
            break;
          case 6:
            value = (x * x + y * y + z * z) * int64_t{greatest} / 768 + jitter / 4;
            break;
          case 7:
            value = greatest;
            break;
          default:
            value = base / 3 + (random() % 3 == 0 ? 1 : 0);
        }
        samples.push_back(static_cast<uint32_t>(std::clamp<int64_t>(value, 0, greatest)));
      }
  return samples;
}

/// Means of 2^3, at the corner (x, y, z) of a page of so many more on its far sides, which are any.
inline std::vector<uint32_t> make_parents(const std::vector<uint32_t>& samples, Extent e, Extent parents,
                                          int x, int y, int z, uint32_t greatest, std::mt19937& random) {
  std::vector<uint32_t> out;
  for (int k = 0; k < parents.nz; ++k)
    for (int j = 0; j < parents.ny; ++j)
      for (int i = 0; i < parents.nx; ++i) {
        uint64_t sum = 0, count = 0;
        for (int child = 0; child < 8; ++child) {
          const int cx = 2 * (i - x) + child % 2, cy = 2 * (j - y) + child / 2 % 2,
                    cz = 2 * (k - z) + child / 4;
          if (cx < 0 || cy < 0 || cz < 0 || cx >= e.nx || cy >= e.ny || cz >= e.nz) continue;
          sum += samples[static_cast<size_t>((cz * e.ny + cy) * e.nx + cx)], ++count;
        }
        out.push_back(static_cast<uint32_t>(count == 0 ? random() % (uint64_t{greatest} + 1)
                                                       : (2 * sum + count) / (2 * count)));
      }
  return out;
}

}  // namespace voxkit::page::test
