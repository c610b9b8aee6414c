// The voxels of a ray by the book: planes are compared as fractions of 128-bit integers. Shares nothing with
// librender but the rules: a ray that lies in a plane belongs to the voxels on the upper side, as it goes;
// planes that are crossed at once are crossed in the order x, y, z.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

namespace voxkit::stress {

using Int = __int128;
/// Origins are multiples of 1 / unit voxels.
constexpr int64_t unit = int64_t{1} << 20;

[[noreturn]] inline void fail(const char* why) {
  std::fprintf(stderr, "stress_traversal: %s\n", why);
  std::abort();
}

/// A ray through a grid. |plane - origin| <= 2^21 voxels for all planes of the grid. A component of the
/// direction is a multiple of 2^-84 times the power of two below the greatest one, or below 2^-42 of that
/// one.
struct TestRay {
  int64_t dims[3];
  int64_t origin[3];  ///< in units
  double direction[3];
  bool has_target;
  int64_t target[3];  ///< planes, one an axis, around which something is close
};

/// The same, mirrored in the middle of the grid where the direction is negative, in integers. All products
/// of a distance to a plane and a direction are below 2^126, their differences below 2^127.
struct Frame {
  explicit Frame(const TestRay& ray) {
    double greatest = 0;
    for (const double d : ray.direction) greatest = std::fmax(greatest, std::fabs(d));
    if (!(greatest >= 0x1p-100 && greatest <= 0x1p100)) fail("direction out of range");
    const int exponent = std::ilogb(greatest) - 84;
    for (int a = 0; a < 3; ++a) {
      mirrored[a] = ray.direction[a] < 0;
      size[a] = std::fabs(ray.direction[a]);
      dims[a] = ray.dims[a];
      origin[a] = mirrored[a] ? dims[a] * unit - ray.origin[a] : ray.origin[a];
      if (dims[a] < 1 || std::abs(origin[a]) > 2 * unit * unit ||
          std::abs(dims[a] * unit - origin[a]) > 2 * unit * unit)
        fail("origin out of range");
      // Distances are between 1 and 2^41 units. So a component below 2^-42 of the greatest crosses no plane
      // before the ray has left the grid, and any such component stands for any other.
      if (size[a] < greatest * 0x1p-42) {
        direction[a] = size[a] > 0 ? 1 : 0;
        continue;
      }
      const double scaled = std::scalbn(size[a], -exponent);
      if (scaled != std::floor(scaled) || scaled >= 0x1p85) fail("direction is no integer");
      direction[a] = static_cast<Int>(scaled);
    }
  }
  /// Plane p of axis a is reached at distance(a, p) / direction[a].
  int64_t distance(int a, int64_t p) const { return p * unit - origin[a]; }
  /// Whether plane p of axis a is crossed before plane q of axis b, neither being behind the origin.
  bool before(int a, int64_t p, int b, int64_t q) const {
    const Int left = distance(a, p) * direction[b], right = distance(b, q) * direction[a];
    return left != right ? left < right : a < b;
  }
  int64_t unmirrored(int a, int64_t v) const { return mirrored[a] ? dims[a] - 1 - v : v; }

  int64_t dims[3], origin[3];
  Int direction[3];
  double size[3];  ///< of the direction as it was given
  bool mirrored[3];
};

/// A voxel of a path, mirrored, and the axis of the plane through which it was entered; -1 at the origin.
struct Place {
  int64_t v[3];
  int axis;

  /// When, correct to 2^-63.
  long double time(const Frame& f) const {
    if (axis < 0) return 0;
    return static_cast<long double>(f.distance(axis, v[axis])) /
           (0x1p20L * static_cast<long double>(f.size[axis]));
  }
  bool inside(const Frame& f) const {
    bool in = true;
    for (int a = 0; a < 3; ++a) in &= v[a] >= 0 && v[a] < f.dims[a];
    return in;
  }
};

/// The plain reference: one plane after the other, from the origin on, inside the grid or not.
class PlainWalk {
 public:
  explicit PlainWalk(const Frame& frame) : f_(frame) {
    for (int a = 0; a < 3; ++a) at_.v[a] = f_.origin[a] >> 20;
    at_.axis = -1;
  }
  void step() {
    int axis = -1;
    for (int a = 0; a < 3; ++a)
      if (f_.direction[a] > 0 && (axis < 0 || f_.before(a, at_.v[a] + 1, axis, at_.v[axis] + 1))) axis = a;
    ++at_.v[at_.axis = axis];
  }
  /// Whether it never enters the grid again.
  bool gone() const {
    for (int a = 0; a < 3; ++a)
      if (at_.v[a] >= f_.dims[a] || (at_.v[a] < 0 && f_.direction[a] == 0)) return true;
    return false;
  }
  const Place& at() const { return at_; }

 private:
  const Frame& f_;
  Place at_;
};

/// The fast references. Long ways in one go, by division:
class Jump {
 public:
  /// Where the ray enters the grid; false if it misses.
  static bool enter(const Frame& f, Place& at) {
    int axis = -1;
    for (int a = 0; a < 3; ++a) {
      if (f.origin[a] >= f.dims[a] * unit) return false;
      if (f.origin[a] >= 0) continue;
      if (f.direction[a] == 0) return false;
      if (axis < 0 || f.before(axis, 0, a, 0)) axis = a;
    }
    for (int a = 0; a < 3; ++a)
      at.v[a] = axis < 0 ? f.origin[a] >> 20 : a == axis ? 0 : settle(f, a, axis, 0);
    at.axis = axis;
    return at.inside(f);
  }
  /// Crosses the first of three planes in the way; false if that leaves the grid.
  static bool cross(const Frame& f, const int64_t (&plane)[3], Place& at) {
    int axis = -1;
    for (int a = 0; a < 3; ++a)
      if (f.direction[a] > 0 && (axis < 0 || f.before(a, plane[a], axis, plane[axis]))) axis = a;
    for (int a = 0; a < 3; ++a) at.v[a] = a == axis ? plane[a] : settle(f, a, axis, plane[axis]);
    at.axis = axis;
    return at.inside(f);
  }

 private:
  /// The coordinate b when plane p of axis a has just been crossed: the last plane of b before that.
  static int64_t settle(const Frame& f, int b, int a, int64_t p) {
    const Int way = f.distance(a, p) * f.direction[b];
    Int whole = way / f.direction[a];
    if (whole * f.direction[a] == way && b > a) whole -= 1;  // crossed at once is crossed later
    const Int v = (f.origin[b] + whole) >> 20, start = f.origin[b] >> 20;
    return static_cast<int64_t>(v > start ? v : start);
  }
};

/// and voxel by voxel, with differences of products that are carried along.
class Stepper {
 public:
  Stepper(const Frame& f, const Place& at) : f_(f), at_(at) {
    for (int a = 0; a < 3; ++a) step_[a] = f.direction[a] << 20;
    for (int k = 0; k < 3; ++k) {
      const int a = k == 2 ? 1 : 0, b = k == 0 ? 1 : 2;
      ahead_[k] = f.distance(a, at.v[a] + 1) * f.direction[b] - f.distance(b, at.v[b] + 1) * f.direction[a];
    }
  }
  /// Moves to the next voxel; false if it is outside the grid.
  bool step() {
    // ahead_[0] <= 0: x comes before y; [1]: x before z; [2]: y before z.
    const int axis = ahead_[0] <= 0 ? (ahead_[1] <= 0 ? 0 : 2) : (ahead_[2] <= 0 ? 1 : 2);
    if (axis == 0) {
      ahead_[0] += step_[1];
      ahead_[1] += step_[2];
    } else if (axis == 1) {
      ahead_[0] -= step_[0];
      ahead_[2] += step_[2];
    } else {
      ahead_[1] -= step_[0];
      ahead_[2] -= step_[1];
    }
    at_.axis = axis;
    return ++at_.v[axis] < f_.dims[axis];
  }
  const Place& at() const { return at_; }

 private:
  const Frame& f_;
  Place at_;
  Int step_[3], ahead_[3];
};

/// Whether the ray has a point in common with a voxel, its faces, edges and corners included.
inline bool touches(const Frame& f, const int64_t (&v)[3]) {
  for (int a = 0; a < 3; ++a) {
    const int64_t near = f.distance(a, v[a]), far = f.distance(a, v[a] + 1);
    if (far < 0 || (f.direction[a] == 0 && near > 0)) return false;
    for (int b = 0; b < 3; ++b)  // near_a / d_a <= far_b / d_b
      if (near > 0 && f.direction[b] > 0 && near * f.direction[b] > f.distance(b, v[b] + 1) * f.direction[a])
        return false;
  }
  return true;
}

}  // namespace voxkit::stress
