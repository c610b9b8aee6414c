// Rays that are hard to follow, in families.
#pragma once

#include <array>
#include <cstdint>
#include <random>

#include "tests/stress/exact_path.h"

namespace voxkit::stress {

/// The same numbers on every machine.
class Random {
 public:
  explicit Random(uint64_t seed) : bits_(seed) {}
  /// lo .. hi
  int64_t number(int64_t lo, int64_t hi) {
    return lo + static_cast<int64_t>(bits_() % static_cast<uint64_t>(hi - lo + 1));
  }
  bool chance(int of) { return number(1, of) == 1; }
  /// A double in [0, 1) with all its bits.
  double fraction() { return static_cast<double>(bits_() >> 11) * 0x1p-53; }
  /// One in [1, 2) with all its bits.
  double mantissa() { return 1 + static_cast<double>(bits_() >> 12) * 0x1p-52; }
  int sign() { return chance(2) ? 1 : -1; }
  /// x or -x
  double either(double x) { return chance(2) ? x : -x; }
  /// lo .. hi, every power of two as likely as any other; lo >= 0.
  int64_t spread(int64_t lo, int64_t hi) {
    const int64_t most = (hi - lo) >> number(0, 63 - __builtin_clzll(static_cast<uint64_t>(hi - lo) | 1));
    return lo + number(0, most);
  }

 private:
  std::mt19937_64 bits_;
};

enum class Family {
  corners,
  edges,
  one_axis,
  two_axes,
  negative_zero,
  tiny,
  faces,
  inside,
  far_off,
  diagonal,
  near_diagonal,
  random,
  any_direction,
  near_ties,
  near_planes,
  worst_times,
  worst_positions,
};
constexpr int families = 17;
extern const char* const family_names[families];

constexpr int grids = 14;
extern const std::array<int64_t, 3> grid_dims[grids];

/// A ray of a family through a grid. The last four families have targets.
TestRay make_ray(Family family, const std::array<int64_t, 3>& dims, Random& random);

/// The largest rounding errors that the search for rays of the last two families has come across.
struct Worst {
  double time = 0;      ///< of the difference of two times, in margins below which GridRay decides exactly
  double position = 0;  ///< of a position, in distances to a plane below which it does
};
extern thread_local Worst worst;

}  // namespace voxkit::stress
