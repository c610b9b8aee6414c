#include "libcolor/surface/triangle_cells.h"

namespace voxkit::color {

TriangleCells::TriangleCells(const SnappedTriangle& triangle, SurfaceKind kind) : kind_(kind) {
  const auto& p = triangle.corners;
  std::array<std::array<int64_t, 3>, 3>
      d{};  // edges, in units of 2^-8 voxel: differences of odd numbers are even
  for (size_t i = 0; i < 3; ++i)
    for (size_t c = 0; c < 3; ++c) d[i][c] = (int64_t{p[(i + 1) % 3][c]} - p[i][c]) / 2;
  for (size_t c = 0; c < 3; ++c) {
    const size_t e = (c + 1) % 3, f = (c + 2) % 3;
    normal_[c] = d[0][e] * d[1][f] - d[0][f] * d[1][e];
    corner_[c] = p[0][c];
    first_[c] = std::min({p[0][c], p[1][c], p[2][c]}) / units_per_voxel;
    last_[c] = std::max({p[0][c], p[1][c], p[2][c]}) / units_per_voxel;
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    const size_t e = (axis + 1) % 3, f = (axis + 2) % 3;
    const int64_t sign = normal_[axis] < 0 ? -1 : 1;
    for (size_t i = 0; i < 3; ++i) {
      Edge& edge = edges_[axis][i];
      edge.a = -sign * d[i][f];
      edge.b = sign * d[i][e];
      edge.c = -(edge.a * p[i][e] + edge.b * p[i][f]);
      const int64_t a = std::abs(edge.a), b = std::abs(edge.b);
      edge.reach = half_voxel * (kind == SurfaceKind::thin ? std::max(a, b) : a + b);
    }
  }
  for (size_t c = 1; c < 3; ++c)
    if (std::abs(normal_[c]) > std::abs(normal_[axis_])) axis_ = c;
  if (normal_[axis_] < 0)
    for (int64_t& n : normal_) n = -n;
}

bool TriangleCells::touches(const Cube& cube) const {
  const int64_t half = int64_t{half_voxel} << cube.bits;
  std::array<int64_t, 3> c{};
  for (size_t i = 0; i < 3; ++i) {
    if (last_[i] < cube.lo[i] || first_[i] >= cube.lo[i] + (int64_t{1} << cube.bits)) return false;
    c[i] = int64_t{cube.lo[i]} * units_per_voxel + half;
  }
  __int128 distance = 0, reach = 0;
  for (size_t i = 0; i < 3; ++i) {
    distance += static_cast<__int128>(normal_[i]) * (c[i] - corner_[i]);
    reach += static_cast<__int128>(std::abs(normal_[i])) * half;
  }
  if (distance > reach || -distance > reach) return false;
  for (size_t axis = 0; axis < 3; ++axis)
    for (const Edge& edge : edges_[axis])
      if (edge.at(c[(axis + 1) % 3], c[(axis + 2) % 3]) + half * (std::abs(edge.a) + std::abs(edge.b)) < 0)
        return false;
  return true;
}

}  // namespace voxkit::color
