// Rays through a grid, exactly: which voxel comes next is decided without rounding (thesis section 3.2.5
// names the problem).
//
// The plane x = p is reached at t = (p - origin) / direction. That is never accumulated: every decision
// compares two such quotients, in doubles where they are far enough apart, else exactly. So a step over a
// large cell lands in the very voxel that single steps would have reached, whatever the length of the way.
#pragma once

#include <cmath>
#include <cstdint>

#include "librender/hd.h"

namespace voxkit::render {

/// A ray in grid coordinates: voxel (i, j, k) is [i, i + 1) x [j, j + 1) x [k, k + 1). Components are
/// mirrored so that no direction is negative. A ray that lies in a plane between voxels belongs to the voxels
/// on its upper side.
class GridRay {
 public:
  /// Origins are multiples of 2^-20 with |origin| < 2^31: `quantise`. Components of the direction below
  /// 2^-200 of the greatest are taken for zero; the direction must not be zero.
  VOX_HD GridRay(const double (&origin)[3], const double (&direction)[3], const int64_t (&dims)[3]) {
    double greatest = 0;
    for (int a = 0; a < 3; ++a)
      greatest = direction[a] > greatest ? direction[a] : -direction[a] > greatest ? -direction[a] : greatest;
    for (int a = 0; a < 3; ++a) {
      dims_[a] = dims[a];
      mirrored_[a] = direction[a] < 0;
      origin_[a] = mirrored_[a] ? static_cast<double>(dims[a]) - origin[a] : origin[a];
      direction_[a] = mirrored_[a] ? -direction[a] : direction[a];
      if (direction_[a] < greatest * 0x1p-200) direction_[a] = 0;
      inverse_[a] = direction_[a] > 0 ? 1 / direction_[a] : 0;
    }
  }
  VOX_HD static double quantise(double x) { return std::floor(x * 0x1p20 + 0.5) * 0x1p-20; }

  /// Moves to the voxel in which the ray enters the grid, at `t` >= 0; false if it misses.
  VOX_HD bool enter(double& t) {
    int axis = -1;
    for (int a = 0; a < 3; ++a) {
      voxel_[a] = static_cast<int64_t>(std::floor(origin_[a]));
      if (origin_[a] >= static_cast<double>(dims_[a]) || (origin_[a] < 0 && direction_[a] == 0)) return false;
      if (origin_[a] < 0 && (axis < 0 || before(axis, 0, a, 0))) axis = a;
    }
    t = 0;
    if (axis < 0) return true;
    advance_to(axis, 0);
    t = time(axis, 0);
    return inside();
  }
  /// Moves to the next voxel outside the cell lo <= v < hi around the current one, entered at `t`; false if
  /// it leaves the grid.
  VOX_HD bool leave(const int64_t (&lo)[3], const int64_t (&hi)[3], double& t) {
    int axis = -1;
    int64_t plane = 0;
    for (int a = 0; a < 3; ++a) {
      if (direction_[a] == 0) continue;
      const int64_t exit = mirrored_[a] ? dims_[a] - lo[a] : hi[a];
      if (axis < 0 || before(a, exit, axis, plane)) axis = a, plane = exit;
    }
    if (hi[0] - lo[0] == 1 && hi[1] - lo[1] == 1 && hi[2] - lo[2] == 1)
      voxel_[axis] = plane;
    else
      advance_to(axis, plane);
    t = time(axis, plane);
    last_axis_ = axis;
    return voxel_[axis] < dims_[axis];
  }
  /// The current voxel.
  VOX_HD int64_t voxel(int a) const { return mirrored_[a] ? dims_[a] - 1 - voxel_[a] : voxel_[a]; }
  /// The axis of the face through which the current voxel was entered; -1 at the start inside the grid.
  VOX_HD int last_axis() const { return last_axis_; }

 private:
  VOX_HD double time(int a, int64_t plane) const {
    return (static_cast<double>(plane) - origin_[a]) * inverse_[a];
  }

  /// Whether plane p of axis a is crossed before plane q of axis b. Crossed at once, the lower axis comes
  /// first.
  VOX_HD bool before(int a, int64_t p, int b, int64_t q) const {
    const double t = time(a, p), u = time(b, q);
    const double margin = 0x1p-49 * (std::fabs(t) + std::fabs(u));
    if (t < u - margin) return true;
    if (t > u + margin) return false;
    // (p - o_a) / d_a < (q - o_b) / d_b, without rounding: both differences are exact, and so are the
    // products as sums of two.
    const double pa = static_cast<double>(p) - origin_[a], qb = static_cast<double>(q) - origin_[b];
    const double left = pa * direction_[b], right = qb * direction_[a];
    if (left != right) return left < right;
    const double left_rest = std::fma(pa, direction_[b], -left),
                 right_rest = std::fma(qb, direction_[a], -right);
    if (left_rest != right_rest) return left_rest < right_rest;
    return a < b;
  }
  /// The crossing of `plane` on `axis` has just happened: sets all coordinates to the planes crossed by then.
  VOX_HD void advance_to(int axis, int64_t plane) {
    const double t = time(axis, plane);
    for (int b = 0; b < 3; ++b) {
      if (b == axis || direction_[b] == 0) continue;
      int64_t v = static_cast<int64_t>(std::floor(origin_[b] + direction_[b] * t));
      v = v < voxel_[b] ? voxel_[b] : v;
      while (before(b, v + 1, axis, plane)) ++v;
      while (v > voxel_[b] && !before(b, v, axis, plane)) --v;
      voxel_[b] = v;
    }
    voxel_[axis] = plane;
    last_axis_ = axis;
  }
  VOX_HD bool inside() const {
    for (int a = 0; a < 3; ++a)
      if (voxel_[a] < 0 || voxel_[a] >= dims_[a]) return false;
    return true;
  }

  double origin_[3], direction_[3], inverse_[3];
  int64_t dims_[3], voxel_[3];
  bool mirrored_[3];
  int last_axis_ = -1;
};

}  // namespace voxkit::render
