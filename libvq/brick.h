// 4^3 bricks of voxels: what a volume is cut into (Guthe and Goesele 2016, section 3).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace voxkit::vq {

inline constexpr int brick_edge = 4;
inline constexpr int brick_voxels = brick_edge * brick_edge * brick_edge;

/// The voxels of a brick in raster order: x fastest, then y, then z.
using Brick = std::array<uint16_t, brick_voxels>;

/// Bricks that all differ, and how often each occurs: counts[i] >= 1 goes with bricks[i].
struct UniqueBricks {
  std::vector<Brick> bricks;
  std::vector<uint64_t> counts;
};

/// The least and the greatest voxel of a brick.
struct BrickRange {
  uint16_t min = 0, max = 0;
  friend bool operator==(const BrickRange&, const BrickRange&) = default;
};
BrickRange range_of(const Brick& brick);

}  // namespace voxkit::vq
