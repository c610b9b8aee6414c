#include "tests/stress/near_ties.h"

#include <algorithm>
#include <cmath>

namespace voxkit::stress {

thread_local Worst worst;

namespace {

/// A ray with its directions taken positive.
struct Tie {
  bool mirrored[3];
  int64_t dims[3];
  int64_t origin[3];  ///< in units, mirrored
  int64_t plane[3];   ///< mirrored
  double direction[3];
  int first, other;  ///< axes: `first` is when, `other` is where

  int64_t distance(int a) const { return plane[a] * unit - origin[a]; }
  long double when() const {
    return distance(first) / static_cast<long double>(direction[first]);
  }  // in units
  /// Whether the ray is in the grid, or at its border, at that time.
  bool reached() const {
    for (int a = 0; a < 3; ++a) {
      const double x = static_cast<double>(origin[a]) + direction[a] * static_cast<double>(when());
      if (x < -0x1p-10 || x > static_cast<double>(dims[a] * unit) + 0x1p-10) return false;
    }
    return true;
  }
  /// GridRay's margins: of times, and of positions (in voxels).
  double time_margin() const {
    double end = 1 / 0.0;
    for (int a = 0; a < 3; ++a)
      end = std::fmin(end, static_cast<double>(dims[a] * unit - origin[a]) * 0x1p-20 / direction[a]);
    return end * 0x1p-48;
  }
  double position_margin() const {
    int64_t side = 1;
    while (side < dims[0] || side < dims[1] || side < dims[2]) side *= 2;
    double reach = 0;
    for (int a = 0; a < 3; ++a) {
      const int64_t o = mirrored[a] ? dims[a] * unit - origin[a] : origin[a];
      reach = std::fmax(reach, std::fabs(static_cast<double>(o)) * 0x1p-20 + 2 * static_cast<double>(side));
    }
    return reach * 0x1p-48;
  }
};

/// How far apart, in margins: about 1, or anything up to 4, or next to nothing.
double margins(Random& random) {
  switch (random.number(0, 7)) {
    case 0:
      return 0;
    case 1:
      return std::exp2(-40 * random.fraction());
    case 2:
    case 3:
      return 4 * random.fraction();
    default:
      return 0.875 + 0.25 * random.fraction();
  }
}

/// Directions that make the planes of `other`, and at times of the third axis, nearly tie with that of
/// `first`.
void tie(Random& random, Closeness closeness, Tie& t) {
  const auto far = [&](int a) { return static_cast<long double>(t.distance(a)); };
  t.direction[t.first] = random.mantissa();
  const long double when = t.when();
  const int third = 3 - t.first - t.other;
  for (int a = 0; a < 3; ++a) {
    if (a == t.first) continue;
    const double off = a == third && random.chance(2) ? 0.3 + 2 * random.fraction() : 1;
    t.direction[a] = static_cast<double>(far(a) / when) * off;
  }
  for (int a = 0; a < 3; ++a) {
    if (a == t.first || std::fabs(t.direction[a] - static_cast<double>(far(a) / when)) > 0) continue;
    const double apart =
        closeness == Closeness::times ? t.time_margin() : t.position_margin() / t.direction[a];
    const long double gap = static_cast<long double>(random.either(margins(random) * apart)) * unit;
    t.direction[a] = static_cast<double>(far(a) / (when + gap));
  }
}

Tie any_tie(Random& random, Closeness closeness, const TestRay& ray) {
  Tie t{};
  t.first = static_cast<int>(random.number(0, 2));
  t.other = (t.first + static_cast<int>(random.number(1, 2))) % 3;
  for (int a = 0; a < 3; ++a) {
    t.dims[a] = ray.dims[a];
    t.mirrored[a] = random.chance(2);
    // A boundary of large aligned cells, or the grid's.
    const int64_t align =
        int64_t{1} << random.number(0, 63 - __builtin_clzll(static_cast<uint64_t>(t.dims[a])));
    const int64_t p =
        random.chance(8) ? (random.chance(2) ? t.dims[a] : 0) : random.number(0, t.dims[a] / align) * align;
    t.plane[a] = t.mirrored[a] ? t.dims[a] - p : p;
    const int64_t way = random.chance(2) ? random.spread(1, 1000000 * unit)
                                         : random.number(1, std::min<int64_t>(2 * t.dims[a], 1000000) * unit);
    t.origin[a] = std::max(t.plane[a] * unit - way, -1000000 * unit);
  }
  tie(random, closeness, t);
  return t;
}

Tie start(Random& random, Closeness closeness, const TestRay& ray) {
  Tie t = any_tie(random, closeness, ray);
  for (int trial = 0; trial < 30 && !t.reached(); ++trial) t = any_tie(random, closeness, ray);
  return t;
}

/// By how much doubles are off, in margins.
double rounding(const Tie& t, Closeness closeness) {
  if (!t.reached()) return 0;
  const auto at = [&](int a) { return static_cast<double>(t.origin[a]) * 0x1p-20; };
  const auto exactly = [&](int a) {
    return static_cast<long double>(t.distance(a)) / (0x1p20L * static_cast<long double>(t.direction[a]));
  };
  const auto in_doubles = [&](int a) {
    return (static_cast<double>(t.plane[a]) - at(a)) * (1 / t.direction[a]);
  };
  if (closeness == Closeness::times) {
    const long double off = static_cast<long double>(in_doubles(t.first)) - exactly(t.first) -
                            (static_cast<long double>(in_doubles(t.other)) - exactly(t.other));
    return std::fabs(static_cast<double>(off)) / t.time_margin();
  }
  const double x = at(t.other) + t.direction[t.other] * in_doubles(t.first);
  const long double exact = static_cast<long double>(at(t.other)) +
                            static_cast<long double>(t.direction[t.other]) * exactly(t.first);
  return std::fabs(static_cast<double>(static_cast<long double>(x) - exact)) / t.position_margin();
}

void put(const Tie& t, TestRay& ray) {
  ray.has_target = true;
  for (int a = 0; a < 3; ++a) {
    ray.origin[a] = t.mirrored[a] ? t.dims[a] * unit - t.origin[a] : t.origin[a];
    ray.direction[a] = t.mirrored[a] ? -t.direction[a] : t.direction[a];
    ray.target[a] = t.mirrored[a] ? t.dims[a] - t.plane[a] : t.plane[a];
  }
}

}  // namespace

void near_tie(Random& random, Closeness closeness, TestRay& ray) {
  put(start(random, closeness, ray), ray);
}

void worst_tie(Random& random, Closeness closeness, TestRay& ray) {
  Tie best = start(random, closeness, ray);
  double most = rounding(best, closeness);
  for (int trial = 0; trial < 300; ++trial) {
    Tie t = best;
    const int a = random.chance(2) ? t.first : t.other;
    if (random.chance(2)) {
      t.direction[a] +=
          static_cast<double>(random.number(-64, 64)) * std::scalbn(1.0, std::ilogb(t.direction[a]) - 52);
    } else {
      const int64_t moved =
          t.origin[a] + static_cast<int64_t>(random.either(static_cast<double>(random.spread(1, unit))));
      if (moved < t.plane[a] * unit && moved >= -1000000 * unit) t.origin[a] = moved;
      // The other one follows, so that the planes stay close to each other.
      const int b = a == t.first ? t.other : t.first;
      t.direction[a] = static_cast<double>(static_cast<long double>(t.distance(a)) *
                                           static_cast<long double>(t.direction[b]) /
                                           static_cast<long double>(t.distance(b)));
    }
    const double off = rounding(t, closeness);
    if (off > most) most = off, best = t;
  }
  double& record = closeness == Closeness::times ? worst.time : worst.position;
  record = std::max(record, most);
  put(best, ray);
}

}  // namespace voxkit::stress
