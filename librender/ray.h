// Rays through a grid, exactly: which voxel comes next is decided without rounding (thesis section 3.2.5
// names the problem).
//
// The plane x = p is reached at t = (p - origin) / direction. That is never accumulated: every decision
// compares two such quotients, in doubles where these are far enough apart, else exactly. So a step over a
// large cell lands in the very voxel that single steps would have reached, whatever the length of the way.
#pragma once

#include <cmath>
#include <cstdint>

#include "librender/exact_ray.h"

namespace voxkit::render {

/// Where rays start, in grid coordinates: voxel (i, j, k) is [i, i + 1) x [j, j + 1) x [k, k + 1). Rays
/// mirror axes about the middle of [0, side), side being a power of two, so that no direction is negative;
/// voxels and aligned cells stay what they are under that. Here is each axis as it is, and mirrored.
struct RayOrigin {
  /// 1 <= dims <= 2^31. The origin is moved to a multiple of 2^-20; |origin| < 2^31.
  VOX_HD RayOrigin(const double (&origin)[3], const int64_t (&dims)[3]) {
    int64_t side = 1;
    while (side < dims[0] || side < dims[1] || side < dims[2]) side *= 2;
    mask = side - 1;
    double reach = 0;  // bounds every coordinate on the way through the grid
    for (int a = 0; a < 3; ++a) {
      const double o = std::floor(origin[a] * 0x1p20 + 0.5) * 0x1p-20;
      at[0][a] = o;
      at[1][a] = static_cast<double>(side) - o;
      near[0][a] = 0;
      near[1][a] = side - dims[a];
      far[0][a] = dims[a];
      far[1][a] = side;
      for (int m = 0; m < 2; ++m) {
        to_near[m][a] = static_cast<double>(near[m][a]) - at[m][a];
        to_far[m][a] = static_cast<double>(far[m][a]) - at[m][a];
      }
      const double bound = std::fabs(o) + 2 * static_cast<double>(side);
      reach = bound > reach ? bound : reach;
    }
    clear = 0.5 - reach * 0x1p-48;
  }
  double at[2][3], to_near[2][3], to_far[2][3];
  int64_t near[2][3], far[2][3];
  double clear;  ///< positions at least this far from the middle of a voxel may be in the next
  int64_t mask;  ///< side - 1
};

/// A ray before it enters the grid, as far as that is arithmetic without decisions: for many rays side by
/// side. The greatest component of the direction is between 2^-100 and 2^100; those below 2^-200 are taken
/// for zero.
struct Approach {
  double direction[3];
  double inverse[3];  ///< of the absolute direction; infinite: never crosses
  double first, end;  ///< when the last near plane and the first far plane are crossed; -1: has none to cross

  VOX_HD_HOT Approach(const RayOrigin& from, const double (&towards)[3]) {
    double t[3], far[3];
    for (int a = 0; a < 3; ++a) {
      const bool mirrored = towards[a] < 0;
      const double size = std::fabs(towards[a]);
      direction[a] = towards[a];
      inverse[a] = 1 / (size < 0x1p-200 ? 0 : size);
      const double to_near = mirrored ? from.to_near[1][a] : from.to_near[0][a],
                   to_far = mirrored ? from.to_far[1][a] : from.to_far[0][a];
      t[a] = to_near > 0 ? to_near * inverse[a] : -1;
      far[a] = to_far > 0 ? to_far * inverse[a] : -1;
    }
    const double near_two = t[0] > t[1] ? t[0] : t[1], far_two = far[0] < far[1] ? far[0] : far[1];
    first = t[2] > near_two ? t[2] : near_two;
    end = far[2] < far_two ? far[2] : far_two;
  }
  VOX_HD_HOT Approach() = default;
  /// Above what quotients up to the end of the grid are off by.
  VOX_HD_HOT double margin() const { return end * 0x1p-48; }
};

/// A ray on its way through a grid. One that lies in a plane between voxels belongs to the voxels on the
/// upper side, as it goes; planes that are crossed at once are crossed in the order x, y, z.
class GridRay {
 public:
  VOX_HD_HOT GridRay(const RayOrigin& from, const Approach& approach)
      : t_(approach.first), margin_(approach.margin()), t_end_(approach.end), clear_(from.clear) {
    for (int a = 0; a < 3; ++a) {
      const int mirrored = approach.direction[a] < 0 ? 1 : 0;
      const double size = std::fabs(approach.direction[a]);
      direction_[a] = size < 0x1p-200 ? 0 : size;
      inverse_[a] = approach.inverse[a];
      origin_[a] = from.at[mirrored][a];
      near_[a] = from.near[mirrored][a];
      far_[a] = from.far[mirrored][a];
      to_near_[a] = from.to_near[mirrored][a];
      flip_[a] = mirrored != 0 ? from.mask : 0;
    }
  }

  /// Moves to the voxel in which the ray enters the grid, at t() >= 0; false if it misses.
  VOX_HD_HOT bool enter() {
    const double first = t_, close = first - margin_;
    if (t_end_ < 0 || first > t_end_ + margin_) return false;
    t_ = first > 0 ? first : 0;  // it may start inside
    int candidates = 0;
    double t[3];
    for (int a = 0; a < 3; ++a) {
      t[a] = to_near_[a] > 0 ? to_near_[a] * inverse_[a] : -1;
      candidates += t[a] >= close;
    }
    int unclear = (first > t_end_ - margin_) | ((first > 0) & (candidates > 1));
    for (int a = 0; a < 3; ++a) {
      const bool crossed = (t[a] > 0) & (t[a] == first);
      const int64_t low = t[a] >= 0 ? near_[a] : static_cast<int64_t>(origin_[a]);
      const Position x = position(a, low, far_[a]);
      unclear |= static_cast<int>(x.unclear) & static_cast<int>(!crossed);
      voxel_[a] = crossed ? near_[a] : x.voxel;
    }
    if (unclear != 0) {
      ExactRay ray = exactly();
      t_ = ray.enter();
      for (int a = 0; a < 3; ++a) voxel_[a] = static_cast<int64_t>(ray.voxel[a]);
    }
    return t_ >= 0;
  }

  /// Moves to the next voxel outside the aligned cell of edge 2^`log2_edge` (at most the grid's side) around
  /// the current one, cut to the grid, entered at t(); false if it leaves the grid.
  VOX_HD_HOT bool leave(int log2_edge) {
    const int64_t within = (int64_t{1} << log2_edge) - 1;
    int64_t plane[3];
    for (int a = 0; a < 3; ++a) {
      const int64_t end = (voxel_[a] | within) + 1;
      plane[a] = end < far_[a] ? end : far_[a];
    }
    return cross(plane, log2_edge > 0);
  }
  /// The same for the box lo <= v < hi around the current voxel and inside the grid.
  VOX_HD_HOT bool leave(const uint32_t (&lo)[3], const uint32_t (&hi)[3]) {
    int64_t plane[3];
    for (int a = 0; a < 3; ++a) plane[a] = flip_[a] != 0 ? flip_[a] + 1 - int64_t{lo[a]} : hi[a];
    return cross(plane, true);
  }

  /// The current voxel.
  VOX_HD_HOT uint32_t voxel(int a) const { return static_cast<uint32_t>(voxel_[a] ^ flip_[a]); }
  /// When it was entered.
  VOX_HD_HOT double t() const { return t_; }

 private:
  VOX_HD_HOT static double least(const double (&t)[3]) {
    const double two = t[0] < t[1] ? t[0] : t[1];
    return t[2] < two ? t[2] : two;
  }
  VOX_HD_HOT double time(int a, int64_t plane) const {
    return (static_cast<double>(plane) - origin_[a]) * inverse_[a];
  }
  /// The coordinate a, known to be in lo .. hi - 1, at t_; unclear where that is too close to a plane to
  /// tell.
  struct Position {
    int64_t voxel;
    bool unclear;
  };
  VOX_HD_HOT Position position(int a, int64_t lo, int64_t hi) const {
    const double x = origin_[a] + direction_[a] * t_;
    const int64_t whole = static_cast<int64_t>(x);
    const int64_t above = whole < lo ? lo : whole;
    return {above < hi ? above : hi - 1, std::fabs(x - static_cast<double>(whole) - 0.5) > clear_};
  }
  /// Crosses the first of three planes in the way. Which one that is cannot be foreseen, so nothing branches
  /// on it. `far`: the other coordinates may change on the way there.
  VOX_HD_HOT bool cross(const int64_t (&plane)[3], bool far) {
    double t[3];
    for (int a = 0; a < 3; ++a) t[a] = time(a, plane[a]);
    t_ = least(t);
    const double close = t_ + margin_;
    int unclear = (t[0] <= close) + (t[1] <= close) + (t[2] <= close) > 1;
    int64_t next[3];
    if (far) {
      for (int a = 0; a < 3; ++a) {
        const bool crossed = t[a] == t_;
        const Position x = position(a, voxel_[a], plane[a]);
        unclear |= static_cast<int>(x.unclear) & static_cast<int>(!crossed);
        next[a] = crossed ? plane[a] : x.voxel;
      }
    } else {
      for (int a = 0; a < 3; ++a) next[a] = t[a] == t_ ? plane[a] : voxel_[a];
    }
    if (unclear != 0) {
      ExactRay ray = exactly();
      t_ = ray.cross(static_cast<double>(plane[0]), static_cast<double>(plane[1]),
                     static_cast<double>(plane[2]));
      for (int a = 0; a < 3; ++a) next[a] = static_cast<int64_t>(ray.voxel[a]);
    }
    for (int a = 0; a < 3; ++a) voxel_[a] = next[a];
    return ((voxel_[0] < far_[0]) & (voxel_[1] < far_[1]) & (voxel_[2] < far_[2])) != 0;
  }
  VOX_HD_HOT ExactRay exactly() const {
    ExactRay ray;
    for (int a = 0; a < 3; ++a) {
      ray.origin[a] = origin_[a];
      ray.direction[a] = direction_[a];
      ray.near[a] = static_cast<double>(near_[a]);
      ray.far[a] = static_cast<double>(far_[a]);
      ray.voxel[a] = static_cast<double>(voxel_[a]);
    }
    return ray;
  }

  double origin_[3], direction_[3], inverse_[3], to_near_[3];
  double t_, margin_, t_end_, clear_;
  int64_t voxel_[3] = {}, near_[3], far_[3], flip_[3];
};

}  // namespace voxkit::render
