// Rays through a grid, exactly: which voxel comes next is decided without rounding (thesis section 3.2.5
// names the problem).
//
// The plane x = p is reached at t = (p - origin) / direction. That is never accumulated: every decision
// compares two such quotients, in doubles where these are far enough apart, else exactly. So a step over a
// large cell lands in the very voxel that single steps would have reached, whatever the length of the way.
#pragma once

#include <cmath>
#include <cstdint>
#include <type_traits>

#include "librender/cast/exact_ray.h"

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

/// Rays are followed one by one (Real is double, Whole int64_t, Bound int64_t) or several side by side (Real
/// and Whole are vectors of doubles, Bound is double): what both do is written once. Conditions on them:
template <class Real>
using Mask = decltype((Real{} < Real{}) & (Real{} < Real{}));
template <class Real>
VOX_HD_HOT Real absolute(const Real& x) {
  if constexpr (std::is_same_v<Real, double>)
    return std::fabs(x);
  else
    return x < 0 ? -x : x;
}
/// The whole part of -1 < x < 2^51, and back.
template <class Whole, class Real>
VOX_HD_HOT Whole whole(const Real& x) {
  if constexpr (std::is_same_v<Whole, int64_t>) {
    return static_cast<int64_t>(x);
  } else {
    const Real nearest = (x + 0x1.8p52) - 0x1.8p52;
    return nearest > x ? nearest - 1 : nearest;
  }
}
template <class Real, class Whole>
VOX_HD_HOT Real real(const Whole& x) {
  if constexpr (std::is_same_v<Whole, int64_t>)
    return static_cast<double>(x);
  else
    return x;
}

/// Along which axes a direction is negative.
struct Mirrored {
  bool axis[3];
  VOX_HD_HOT explicit Mirrored(const double (&direction)[3])
      : axis{direction[0] < 0, direction[1] < 0, direction[2] < 0} {}
  VOX_HD_HOT bool operator==(const Mirrored&) const = default;
};

/// A ray before it enters the grid, as far as that is arithmetic without decisions: for many rays side by
/// side. The greatest component of the direction is between 2^-100 and 2^100; those below 2^-200 are taken
/// for zero.
template <class Real>
struct Approach {
  Real direction[3];  ///< absolute
  Real inverse[3];    ///< of that; infinite: never crosses
  Real first, end;    ///< when the last near plane and the first far plane are crossed; -1: has none to cross

  VOX_HD_HOT Approach(const RayOrigin& from, const Real (&towards)[3], const Mirrored& mirrored) {
    const Real zero{}, never = zero - 1;
    Real near[3], far[3];
    for (int a = 0; a < 3; ++a) {
      const Real size = absolute(towards[a]);
      direction[a] = size < 0x1p-200 ? zero : size;
      inverse[a] = 1 / direction[a];
      const double to_near = mirrored.axis[a] ? from.to_near[1][a] : from.to_near[0][a],
                   to_far = mirrored.axis[a] ? from.to_far[1][a] : from.to_far[0][a];
      near[a] = to_near > 0 ? to_near * inverse[a] : never;
      far[a] = to_far > 0 ? to_far * inverse[a] : never;
    }
    const Real near_two = near[0] > near[1] ? near[0] : near[1], far_two = far[0] < far[1] ? far[0] : far[1];
    first = near[2] > near_two ? near[2] : near_two;
    end = far[2] < far_two ? far[2] : far_two;
  }
  VOX_HD_HOT Approach() = default;
};

/// What is known of rays on their way through a grid, and what moves them where doubles suffice. A ray that
/// lies in a plane between voxels belongs to the voxels on the upper side, as it goes; planes that are
/// crossed at once are crossed in the order x, y, z.
template <class Real, class Whole, class Bound>
struct RayMotion {
  Real direction[3], inverse[3];
  Real t;       ///< when the current voxel was entered
  Real margin;  ///< above what quotients up to the end of the grid are off by
  Real end;
  Whole voxel[3];
  double origin[3], to_near[3], clear;
  Bound near[3], far[3];

  VOX_HD_HOT RayMotion(const RayOrigin& from, const Approach<Real>& approach, const Mirrored& mirrored)
      : t(approach.first), margin(approach.end * 0x1p-48), end(approach.end), clear(from.clear) {
    for (int a = 0; a < 3; ++a) {
      const int m = mirrored.axis[a] ? 1 : 0;
      direction[a] = approach.direction[a];
      inverse[a] = approach.inverse[a];
      voxel[a] = Whole{};
      origin[a] = from.at[m][a];
      to_near[a] = from.to_near[m][a];
      near[a] = static_cast<Bound>(from.near[m][a]);
      far[a] = static_cast<Bound>(from.far[m][a]);
    }
  }

  /// A ray that does not miss the grid.
  VOX_HD_HOT Mask<Real> may_enter() const { return (end >= 0) & (t <= end + margin); }
  /// Moves to the voxel in which the ray enters the grid. Returns where that was unclear.
  VOX_HD_HOT Mask<Real> enter() {
    const Real first = t, close = first - margin, zero{};
    t = first > 0 ? first : zero;  // it may start inside
    Real crossing[3];
    Mask<Real> one{}, two{};
    for (int a = 0; a < 3; ++a) {
      crossing[a] = to_near[a] > 0 ? to_near[a] * inverse[a] : zero - 1;
      two |= one & (crossing[a] >= close);
      one |= crossing[a] >= close;
    }
    Mask<Real> unclear = (first > end - margin) | ((first > 0) & two);
    for (int a = 0; a < 3; ++a) {
      const Whole from = Whole{} + near[a],
                  start = Whole{} + static_cast<Bound>(static_cast<int64_t>(origin[a]));
      const Position x = position(a, crossing[a] >= 0 ? from : start, Whole{} + far[a], t);
      unclear |= x.unclear & ((crossing[a] <= 0) | (crossing[a] != first));
      voxel[a] = ((crossing[a] > 0) & (crossing[a] == first)) ? from : x.voxel;
    }
    return unclear;
  }
  /// Finds where the first of three planes in the way is crossed: `next` and `when`. Returns where that is
  /// unclear. Which plane that is cannot be foreseen, so nothing branches on it. `far`: the other coordinates
  /// may change on the way there.
  VOX_HD_HOT Mask<Real> cross(const Whole (&plane)[3], bool far_away, Whole (&next)[3], Real& when) const {
    Real crossing[3];
    for (int a = 0; a < 3; ++a) crossing[a] = (real<Real>(plane[a]) - origin[a]) * inverse[a];
    const Real sooner = crossing[0] < crossing[1] ? crossing[0] : crossing[1];
    when = crossing[2] < sooner ? crossing[2] : sooner;
    const Real close = when + margin;
    const Mask<Real> x_or_y = (crossing[0] <= close) | (crossing[1] <= close);
    Mask<Real> unclear =
        ((crossing[0] <= close) & (crossing[1] <= close)) | (x_or_y & (crossing[2] <= close));
    for (int a = 0; a < 3; ++a) {
      if (far_away) {
        const Position x = position(a, voxel[a], plane[a], when);
        unclear |= x.unclear & (crossing[a] != when);
        next[a] = crossing[a] == when ? plane[a] : x.voxel;
      } else {
        next[a] = crossing[a] == when ? plane[a] : voxel[a];
      }
    }
    return unclear;
  }

 private:
  /// A coordinate; unclear where it is too close to a plane to tell.
  struct Position {
    Whole voxel;
    Mask<Real> unclear;
  };
  /// The coordinate a at a time, known to be in lo .. hi - 1.
  VOX_HD_HOT Position position(int a, const Whole& lo, const Whole& hi, const Real& when) const {
    const Real x = origin[a] + direction[a] * when;
    const Whole at = whole<Whole>(x), above = at < lo ? lo : at;
    return {above < hi ? above : hi - 1, absolute(Real(x - real<Real>(at) - 0.5)) > clear};
  }
};

/// A ray on its way through a grid.
class GridRay {
 public:
  VOX_HD_HOT GridRay(const RayOrigin& from, const double (&towards)[3])
      : GridRay(from, towards, Mirrored(towards)) {}

  /// Moves to the voxel in which the ray enters the grid, at t() >= 0; false if it misses.
  VOX_HD_HOT bool enter() {
    if (!motion_.may_enter()) return false;
    if (motion_.enter() != 0) {
      ExactRay ray = exactly();
      motion_.t = ray.enter();
      for (int a = 0; a < 3; ++a) motion_.voxel[a] = static_cast<int64_t>(ray.voxel[a]);
    }
    return motion_.t >= 0;
  }
  /// Goes on in a voxel that it is known to enter at t >= 0.
  VOX_HD_HOT void resume(double t, const uint32_t (&voxel)[3]) {
    motion_.t = t;
    for (int a = 0; a < 3; ++a) motion_.voxel[a] = int64_t{voxel[a]} ^ flip_[a];
  }

  /// Moves to the next voxel outside the aligned cell of edge 2^`log2_edge` (at most the grid's side) around
  /// the current one, cut to the grid, entered at t(); false if it leaves the grid.
  VOX_HD_HOT bool leave(int log2_edge) {
    const int64_t within = (int64_t{1} << log2_edge) - 1;
    int64_t plane[3];
    for (int a = 0; a < 3; ++a) {
      const int64_t beyond = (motion_.voxel[a] | within) + 1;
      plane[a] = beyond < motion_.far[a] ? beyond : motion_.far[a];
    }
    return move(plane, log2_edge > 0);
  }
  /// The same for the box lo <= v < hi around the current voxel and inside the grid.
  VOX_HD_HOT bool leave(const uint32_t (&lo)[3], const uint32_t (&hi)[3]) {
    int64_t plane[3];
    for (int a = 0; a < 3; ++a) plane[a] = flip_[a] != 0 ? flip_[a] + 1 - int64_t{lo[a]} : hi[a];
    return move(plane, true);
  }

  /// The current voxel.
  VOX_HD_HOT uint32_t voxel(int a) const { return static_cast<uint32_t>(motion_.voxel[a] ^ flip_[a]); }
  /// When it was entered.
  VOX_HD_HOT double t() const { return motion_.t; }

 private:
  VOX_HD_HOT GridRay(const RayOrigin& from, const double (&towards)[3], const Mirrored& mirrored)
      : motion_(from, Approach<double>(from, towards, mirrored), mirrored) {
    for (int a = 0; a < 3; ++a) flip_[a] = mirrored.axis[a] ? from.mask : 0;
  }
  VOX_HD_HOT bool move(const int64_t (&plane)[3], bool far_away) {
    int64_t next[3];
    if (motion_.cross(plane, far_away, next, motion_.t) != 0) {
      ExactRay ray = exactly();
      motion_.t = ray.cross(static_cast<double>(plane[0]), static_cast<double>(plane[1]),
                            static_cast<double>(plane[2]));
      for (int a = 0; a < 3; ++a) next[a] = static_cast<int64_t>(ray.voxel[a]);
    }
    for (int a = 0; a < 3; ++a) motion_.voxel[a] = next[a];
    return ((next[0] < motion_.far[0]) & (next[1] < motion_.far[1]) & (next[2] < motion_.far[2])) != 0;
  }
  VOX_HD_HOT ExactRay exactly() const {
    ExactRay ray;
    for (int a = 0; a < 3; ++a) {
      ray.origin[a] = motion_.origin[a];
      ray.direction[a] = motion_.direction[a];
      ray.near[a] = static_cast<double>(motion_.near[a]);
      ray.far[a] = static_cast<double>(motion_.far[a]);
      ray.voxel[a] = static_cast<double>(motion_.voxel[a]);
    }
    return ray;
  }

  RayMotion<double, int64_t, int64_t> motion_;
  int64_t flip_[3];
};

}  // namespace voxkit::render
