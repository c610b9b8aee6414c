// Which voxels a triangle is in, decided in integers.
//
// Corners lie on a grid of 2^-9 voxel, at odd places: a corner is at the middle of one of the 256 steps that
// a voxel edge has. So no corner and no face of an axis-aligned box lies between two voxels, and what is
// decided does not depend on how the boxes are taken that the work is split into.
//
// The tests are those of Schwarz and Seidel, "Fast parallel surface and solid voxelization on GPUs" (2010):
// the triangle's box meets that of the voxel; its plane meets, and so do the edges of its projection along
// each axis, the voxel's box (conservative: these are all axes that can separate a triangle and a box), or
// the cross of the three segments between the centres of opposite faces (thin). Each test is closed: what
// touches, meets. A triangle that meets the cross passes the thin tests, hence every path of voxels that
// share faces, which leads through a surface, has a voxel of the surface in it.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>

#include "libcolor/surface/morton.h"

namespace voxkit::color {

inline constexpr int units_per_voxel = 512, half_voxel = 256;

/// Corners in units of 2^-9 voxel: odd, from 0 to 2^30.
struct SnappedTriangle {
  std::array<std::array<int32_t, 3>, 3> corners{};
};

enum class SurfaceKind { thin, conservative };

/// A cube of voxels: side 2^bits, its lowest corner at a multiple of the side.
struct Cube {
  std::array<int32_t, 3> lo{};
  int bits = 0;
};

/// What is the same for all voxels that a triangle is tested with.
class TriangleCells {
 public:
  TriangleCells(const SnappedTriangle& triangle, SurfaceKind kind);

  /// The triangle has no area; then it is in no voxel of a thin surface, and in all that its edges touch of a
  /// conservative one.
  bool flat() const { return normal_[0] == 0 && normal_[1] == 0 && normal_[2] == 0; }

  /// Whether the triangle touches the closed cube. Where it does not, it is in none of its voxels.
  bool touches(const Cube& cube) const;

  /// Most voxels of a row of a cube that emit is called for, one row after the other.
  static size_t most_in_row(const Cube& cube) { return size_t{4} << cube.bits; }

  /// Calls before_row() for each row of the cube, and emit(code) for each of its voxels that the triangle is
  /// in, with the Morton code of its place in the cube. Sides are up to 2^8.
  template <class BeforeRow, class Emit>
  void each_cell(const Cube& cube, BeforeRow&& before_row, Emit&& emit) const {
    if (flat()) {
      if (kind_ == SurfaceKind::conservative) each_flat_cell(cube, before_row, emit);
    } else if (normal_[axis_] < int64_t{1} << 44) {
      walk<int64_t>(cube, before_row, emit);
    } else {
      walk<__int128>(cube, before_row, emit);
    }
  }

  /// Voxels that the triangle's box meets: first and last.
  const std::array<int32_t, 3>& first() const { return first_; }
  const std::array<int32_t, 3>& last() const { return last_; }

 private:
  /// Inside of an edge of the projection along an axis: a * p[axis + 1] + b * p[axis + 2] + c >= 0.
  struct Edge {
    int64_t a, b, c;
    int64_t reach;  ///< of the voxel around its centre, in the edge's measure
    int64_t at(int64_t x, int64_t y) const { return a * x + b * y + c; }
  };
  struct Span {
    int64_t first, last;
    /// Narrows to the columns whose centre, at 512 i + 256, has a * centre + rest >= 0.
    void narrow(int64_t a, int64_t rest) {
      if (a > 0)
        first = std::max(first, -floor_div(rest + half_voxel * a, units_per_voxel * a));
      else if (a < 0)
        last = std::min(last, floor_div(rest + half_voxel * a, -units_per_voxel * a));
      else if (rest < 0)
        last = first - 1;
    }
  };
  template <class T>
  static T floor_div(T a, T b) {
    const T q = a / b;
    return q - ((a % b) < 0);
  }
  static int64_t centre(int64_t voxel) { return voxel * units_per_voxel + half_voxel; }

  /// Whether the voxel passes the tests of the edges of the projection along an axis.
  bool passes_edges(int axis, const std::array<int64_t, 3>& c) const {
    const int64_t x = c[static_cast<size_t>((axis + 1) % 3)], y = c[static_cast<size_t>((axis + 2) % 3)];
    for (const Edge& edge : edges_[static_cast<size_t>(axis)])
      if (edge.at(x, y) + edge.reach < 0) return false;
    return true;
  }

  template <class BeforeRow, class Emit>
  void each_flat_cell(const Cube& cube, BeforeRow&& before_row, Emit&& emit) const;
  template <class T, class BeforeRow, class Emit>
  void walk(const Cube& cube, BeforeRow&& before_row, Emit&& emit) const;

  SurfaceKind kind_;
  std::array<int64_t, 3> normal_{}, corner_{};  ///< normal: that along axis_ is positive
  size_t axis_ = 0;                             ///< along which the normal is longest
  std::array<int32_t, 3> first_{}, last_{};
  std::array<std::array<Edge, 3>, 3> edges_{};  ///< [axis][edge]
};

template <class BeforeRow, class Emit>
void TriangleCells::each_flat_cell(const Cube& cube, BeforeRow&& before_row, Emit&& emit) const {
  std::array<int64_t, 3> lo, hi;
  for (size_t i = 0; i < 3; ++i) {
    lo[i] = std::max(first_[i], cube.lo[i]);
    hi[i] = std::min<int64_t>(last_[i], cube.lo[i] + (int64_t{1} << cube.bits) - 1);
  }
  for (int64_t z = lo[2]; z <= hi[2]; ++z)
    for (int64_t y = lo[1]; y <= hi[1]; ++y) {
      before_row();
      for (int64_t x = lo[0]; x <= hi[0]; ++x) {
        const std::array<int64_t, 3> c{centre(x), centre(y), centre(z)};
        if (passes_edges(0, c) && passes_edges(1, c) && passes_edges(2, c))
          emit(spread_bits(static_cast<uint64_t>(x - cube.lo[0])) |
               spread_bits(static_cast<uint64_t>(y - cube.lo[1])) << 1 |
               spread_bits(static_cast<uint64_t>(z - cube.lo[2])) << 2);
      }
    }
}

/// Columns along the normal's longest axis w. In a column the plane is at one height: the voxels around it
/// are found by one division a row and steps from column to column. Where the column's centre (thin) or all
/// of the column (conservative) is within the triangle's projection, these voxels pass every test; else they
/// are tested.
template <class T, class BeforeRow, class Emit>
void TriangleCells::walk(const Cube& cube, BeforeRow&& before_row, Emit&& emit) const {
  const size_t w = axis_, u = (w + 1) % 3, v = (w + 2) % 3;
  std::array<int64_t, 3> lo, hi;
  for (size_t i = 0; i < 3; ++i) {
    lo[i] = std::max(first_[i], cube.lo[i]);
    hi[i] = std::min<int64_t>(last_[i], cube.lo[i] + (int64_t{1} << cube.bits) - 1);
    if (lo[i] > hi[i]) return;
  }
  const bool thin = kind_ == SurfaceKind::thin;
  const T step = T{units_per_voxel} * normal_[w];
  const T sum = T{normal_[w]} + (thin ? 0 : std::abs(normal_[u]) + std::abs(normal_[v]));
  const T reach = units_per_voxel * sum;  // of the voxel along the normal, both ways
  const T step_u = T{units_per_voxel} * normal_[u], step_v = T{units_per_voxel} * normal_[v];
  // The highest voxel of column (u, v) is floor(height / step), with the rest `rest`.
  __int128 height = half_voxel * (static_cast<__int128>(sum) - normal_[w]);
  height += static_cast<__int128>(normal_[w]) * corner_[w];
  height += static_cast<__int128>(normal_[u]) * (corner_[u] - centre(lo[u]));
  height += static_cast<__int128>(normal_[v]) * (corner_[v] - centre(lo[v]));
  auto row_top = static_cast<int64_t>(floor_div<__int128>(height, step));
  auto row_rest = static_cast<T>(height - static_cast<__int128>(row_top) * step);
  const auto advance = [&](int64_t& top, T& rest, T by) {
    rest -= by;
    if (rest < 0) {
      rest += step;
      --top;
    } else if (rest >= step) {
      rest -= step;
      ++top;
    }
  };
  const auto& edges = edges_[w];
  for (int64_t row = lo[v]; row <= hi[v]; ++row, advance(row_top, row_rest, step_v)) {
    Span outer{lo[u], hi[u]}, inner{lo[u], hi[u]};
    for (const Edge& edge : edges) {
      const int64_t rest = edge.b * centre(row) + edge.c;
      outer.narrow(edge.a, rest + edge.reach);
      inner.narrow(edge.a, thin ? rest : rest - edge.reach);
    }
    if (outer.first > outer.last) continue;
    before_row();
    const uint64_t row_code = spread_bits(static_cast<uint64_t>(row - cube.lo[v])) << v;
    int64_t top = row_top;
    T rest = row_rest;
    if (const int64_t skipped = outer.first - lo[u]; skipped > 0) {
      rest -= step_u * skipped;
      const T whole = floor_div(rest, step);
      top += static_cast<int64_t>(whole);
      rest -= whole * step;
    }
    for (int64_t column = outer.first; column <= outer.last; ++column, advance(top, rest, step_u)) {
      const T below = reach - rest;
      int64_t bottom = top - (below >= step) - (below >= 2 * step) - (below >= 3 * step);
      const bool sure = column >= inner.first && column <= inner.last;
      const uint64_t column_code = row_code | spread_bits(static_cast<uint64_t>(column - cube.lo[u])) << u;
      for (bottom = std::max(bottom, lo[w]); bottom <= std::min(top, hi[w]); ++bottom) {
        if (!sure) {
          std::array<int64_t, 3> c;
          c[u] = centre(column), c[v] = centre(row), c[w] = centre(bottom);
          if (!passes_edges(static_cast<int>(u), c) || !passes_edges(static_cast<int>(v), c)) continue;
        }
        emit(column_code | spread_bits(static_cast<uint64_t>(bottom - cube.lo[w])) << w);
      }
    }
  }
}

}  // namespace voxkit::color
