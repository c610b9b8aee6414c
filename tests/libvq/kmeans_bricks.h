// Bricks that make k-means work hard.
#pragma once

#include <algorithm>
#include <random>
#include <vector>

#include "libvq/brick.h"

namespace voxkit::vq::test {

enum class Kind {
  noise,     ///< every voxel as likely as any other
  clusters,  ///< a few shapes with a little noise
  ramps,     ///< smooth, from void to full
  few,       ///< two values: all distances are multiples of one
  repeated,  ///< each brick several times
  extremes,  ///< all 0, all full, alternating, and these with one other voxel
  line,      ///< along one axis, evenly: nothing but ties
};
inline constexpr Kind all_kinds[] = {Kind::noise,    Kind::clusters, Kind::ramps, Kind::few,
                                     Kind::repeated, Kind::extremes, Kind::line};

inline std::vector<Brick> make_bricks(Kind kind, size_t count, int bits, uint32_t seed) {
  std::mt19937 random(seed);
  const uint32_t top = (1u << bits) - 1;
  std::vector<Brick> bricks(count);
  std::vector<Brick> shapes(7);
  for (Brick& shape : shapes)
    for (uint16_t& v : shape) v = static_cast<uint16_t>(random() & top);
  for (size_t i = 0; i < count; ++i) {
    const auto place = static_cast<uint32_t>(i);
    const uint32_t a = static_cast<uint32_t>(random()), slope = static_cast<uint32_t>(random());
    if (kind == Kind::repeated && i % 3 != 0) {
      bricks[i] = bricks[random() % i];
      continue;
    }
    for (uint32_t v = 0; v < brick_voxels; ++v) {
      const uint32_t noise = static_cast<uint32_t>(random());
      int64_t value = 0;
      switch (kind) {
        case Kind::noise:
        case Kind::repeated:
          value = noise & top;
          break;
        case Kind::clusters:
          value = shapes[a % shapes.size()][v] + static_cast<int64_t>(noise % (1 + top / 16)) - top / 32;
          break;
        case Kind::ramps:
          value = (a & top) + (v % 4) * int64_t{slope % 64} - (v / 16) * int64_t{slope / 64 % 64} + noise % 4;
          break;
        case Kind::few:
          value = noise % 7 == 0 ? top : 0;
          break;
        case Kind::extremes:
          value = place % 4 == 0 ? 0 : place % 4 == 1 ? top : (v + place) % 2 * int64_t{top};
          if (v == a % brick_voxels) value = slope & top;
          break;
        case Kind::line:
          value = place % (top + 1);
          break;
      }
      bricks[i][v] = static_cast<uint16_t>(std::clamp<int64_t>(value, 0, top));
    }
  }
  if (kind == Kind::extremes && count >= 4)
    for (uint32_t v = 0; v < brick_voxels; ++v) {
      bricks[0][v] = 0;
      bricks[1][v] = static_cast<uint16_t>(top);
      bricks[2][v] = static_cast<uint16_t>(v % 2 * top);
      bricks[3][v] = static_cast<uint16_t>((v + 1) % 2 * top);
    }
  return bricks;
}

}  // namespace voxkit::vq::test
