// What doubles do not settle about a ray: planes that are crossed at nearly the same time.
#pragma once

#include <cmath>

#include "formats/hd.h"

namespace voxkit::render {

/// A ray as GridRay sees it: no direction is negative, all numbers but the direction are multiples of 2^-20
/// below 2^32, voxels and planes whole numbers.
struct ExactRay {
  double origin[3], direction[3], near[3], far[3], voxel[3];

  /// Moves to where the ray enters near <= v < far. Returns when, or -1 if it misses.
  VOX_HD_COLD double enter() {
    int axis = -1;  // whose near plane is crossed last
    for (int a = 0; a < 3; ++a)
      if (origin[a] < near[a] && (axis < 0 || before(axis, near[axis], a, near[a]))) axis = a;
    for (int a = 0; a < 3 && axis >= 0; ++a)  // no far plane is crossed before
      if (a != axis && direction[a] > 0 && !before(axis, near[axis], a, far[a])) return -1;
    for (int a = 0; a < 3; ++a) {
      const double first = origin[a] > near[a] ? std::floor(origin[a]) : near[a];
      voxel[a] = axis < 0 ? first : a == axis ? near[a] : settle(a, first, far[a], axis, near[axis]);
    }
    return axis < 0 ? 0 : time(axis, near[axis]);
  }
  /// Crosses the first of the planes (x, y, z), one on each axis. Returns when.
  VOX_HD_COLD double cross(double x, double y, double z) {
    const double plane[3] = {x, y, z};
    int axis = -1;
    for (int a = 0; a < 3; ++a)
      if (direction[a] > 0 && (axis < 0 || before(a, plane[a], axis, plane[axis]))) axis = a;
    for (int a = 0; a < 3; ++a)
      voxel[a] = a == axis ? plane[a] : settle(a, voxel[a], plane[a], axis, plane[axis]);
    return time(axis, plane[axis]);
  }

 private:
  VOX_HD double time(int a, double plane) const { return (plane - origin[a]) * (1 / direction[a]); }

  /// Whether plane p of axis a is crossed before plane q of axis b: (p - o_a) / d_a < (q - o_b) / d_b,
  /// without rounding. Both differences are exact, and so are the products as sums of two.
  VOX_HD bool before(int a, double p, int b, double q) const {
    const double pa = p - origin[a], qb = q - origin[b];
    const double left = pa * direction[b], right = qb * direction[a];
    if (left != right) return left < right;
    const double left_rest = std::fma(pa, direction[b], -left),
                 right_rest = std::fma(qb, direction[a], -right);
    if (left_rest != right_rest) return left_rest < right_rest;
    return a < b;
  }
  /// The coordinate b, known to be in lo .. hi - 1, when `plane` of `axis` has just been crossed.
  VOX_HD double settle(int b, double lo, double hi, int axis, double plane) const {
    const double x = std::floor(origin[b] + direction[b] * time(axis, plane));
    double v = x < lo ? lo : x >= hi ? hi - 1 : x;
    if (direction[b] == 0) return v;
    while (v + 1 < hi && before(b, v + 1, axis, plane)) v += 1;
    while (v > lo && !before(b, v, axis, plane)) v -= 1;
    return v;
  }
};

}  // namespace voxkit::render
