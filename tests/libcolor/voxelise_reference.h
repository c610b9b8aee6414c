// Which voxels a triangle is in, voxel by voxel, as the definitions in triangle_cells.h have it: in 128 bits,
// by projecting corners and nothing else.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "libcolor/surface/triangle_cells.h"

namespace voxkit::color {

using Wide = __int128;
using WidePoint = std::array<Wide, 3>;

inline Wide project(const WidePoint& axis, const WidePoint& p) {
  return axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2];
}

/// Whether the closed ranges of two sets of points along an axis have a number in common.
template <class A, class B>
bool ranges_meet(const WidePoint& axis, const A& a, const B& b) {
  const auto range = [&](const auto& points) {
    Wide least = project(axis, points[0]), most = least;
    for (const WidePoint& p : points) {
      least = std::min(least, project(axis, p));
      most = std::max(most, project(axis, p));
    }
    return std::pair(least, most);
  };
  const auto [a0, a1] = range(a);
  const auto [b0, b1] = range(b);
  return a0 <= b1 && b0 <= a1;
}

inline WidePoint wide_cross(const WidePoint& a, const WidePoint& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

class ReferenceCells {
 public:
  explicit ReferenceCells(const SnappedTriangle& triangle) {
    for (size_t i = 0; i < 3; ++i)
      for (size_t c = 0; c < 3; ++c) corners_[i][c] = triangle.corners[i][c];
    for (size_t i = 0; i < 3; ++i)
      for (size_t c = 0; c < 3; ++c) edges_[i][c] = corners_[(i + 1) % 3][c] - corners_[i][c];
    normal_ = wide_cross(edges_[0], edges_[1]);
  }

  /// No axis separates the triangle from the closed box.
  bool conservative(int64_t x, int64_t y, int64_t z) const {
    const std::array<Wide, 3> lo{x * units_per_voxel, y * units_per_voxel, z * units_per_voxel};
    std::array<WidePoint, 8> box;
    for (size_t i = 0; i < 8; ++i)
      for (size_t c = 0; c < 3; ++c) box[i][c] = lo[c] + ((i >> c) & 1) * units_per_voxel;
    if (!ranges_meet(normal_, corners_, box)) return false;
    for (size_t c = 0; c < 3; ++c) {
      if (!ranges_meet(unit(c), corners_, box)) return false;
      for (const WidePoint& edge : edges_)
        if (!ranges_meet(wide_cross(edge, unit(c)), corners_, box)) return false;
    }
    return true;
  }

  /// The triangle has an area, its box meets the voxel's, its plane meets the cross of the voxel, and in each
  /// projection each edge has a part of the cross on the triangle's side.
  bool thin(int64_t x, int64_t y, int64_t z) const {
    if (normal_ == WidePoint{0, 0, 0}) return false;
    const std::array<Wide, 3> lo{x * units_per_voxel, y * units_per_voxel, z * units_per_voxel};
    std::array<WidePoint, 6> cross_points;
    for (size_t i = 0; i < 6; ++i)
      for (size_t c = 0; c < 3; ++c)
        cross_points[i][c] = lo[c] + (i / 2 != c ? half_voxel : (i % 2) * units_per_voxel);
    for (size_t c = 0; c < 3; ++c) {
      const std::array<WidePoint, 2> box{
          WidePoint{lo[0], lo[1], lo[2]},
          {lo[0] + units_per_voxel, lo[1] + units_per_voxel, lo[2] + units_per_voxel}};
      if (!ranges_meet(unit(c), corners_, box)) return false;
    }
    if (!ranges_meet(normal_, std::array<WidePoint, 1>{corners_[0]}, cross_points)) return false;
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < 3; ++i) {
        // Points at the edge's line have the same product with this axis, the others that of the third
        // corner's side.
        const WidePoint axis = wide_cross(edges_[i], unit(c));
        const Wide line = project(axis, corners_[i]), third = project(axis, corners_[(i + 2) % 3]);
        bool below = false, above = false;
        for (const WidePoint& p : cross_points) {
          below |= project(axis, p) <= line;
          above |= project(axis, p) >= line;
        }
        const bool meets = third < line ? below : third > line ? above : below && above;
        if (!meets) return false;
      }
    return true;
  }

  bool in(SurfaceKind kind, int64_t x, int64_t y, int64_t z) const {
    return kind == SurfaceKind::thin ? thin(x, y, z) : conservative(x, y, z);
  }

 private:
  static WidePoint unit(size_t c) {
    WidePoint axis{0, 0, 0};
    axis[c] = 1;
    return axis;
  }
  std::array<WidePoint, 3> corners_{}, edges_{};
  WidePoint normal_{};
};

}  // namespace voxkit::color
