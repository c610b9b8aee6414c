#include "tests/stress/ray_families.h"

#include <algorithm>
#include <cmath>

#include "tests/stress/near_ties.h"

namespace voxkit::stress {

const char* const family_names[families] = {
    "through lattice corners",
    "through lattice edges",
    "parallel to an axis",
    "parallel to two axes' plane",
    "negative zero components",
    "denormal and tiny components",
    "starting on faces",
    "starting inside",
    "starting 10^6 voxels away",
    "diagonals",
    "one ulp off diagonals",
    "from outside, aimed",
    "any direction",
    "times a margin apart",
    "positions a margin off planes",
    "worst rounding of times",
    "worst rounding of positions",
};

const std::array<int64_t, 3> grid_dims[grids] = {
    {1, 1, 1},
    {2, 2, 2},
    {3, 3, 3},
    {7, 7, 7},
    {100, 100, 100},
    {243, 243, 243},
    {1000, 1000, 1000},
    {1 << 15, 1 << 15, 1 << 15},
    {1 << 20, 1 << 20, 1 << 20},
    {1 << 20, 1, 1},
    {1, 1 << 20, 3},
    {1000, 7, 1 << 15},
    {1 << 15, 1 << 15, 1},
    {3, 100, 1 << 20},
};

namespace {

using Dims = std::array<int64_t, 3>;
constexpr int64_t far_away = 1000000;

/// A point in the grid, in units.
int64_t point(Random& random, int64_t dim) {
  return random.number(0, dim * unit - 1);
}
/// A coordinate of an origin: up to twice the grid's size before it or behind.
int64_t around(Random& random, int64_t dim) {
  const int64_t most = std::min(2 * dim, far_away) * unit;
  return random.number(-most, dim * unit + most);
}
void aim(Random& random, TestRay& ray) {
  const double length = random.mantissa();
  for (size_t a = 0; a < 3; ++a)
    ray.direction[a] = static_cast<double>(point(random, ray.dims[a]) - ray.origin[a]) * length;
}
/// Puts the origin on the line through a lattice point in the grid, at a multiple of direction / 2^20.
void back_from_corner(Random& random, TestRay& ray, const Dims& direction) {
  int64_t largest = 1, most = 1;
  for (size_t a = 0; a < 3; ++a) {
    largest = std::max(largest, std::abs(direction[a]));
    most = std::max(most, ray.dims[a]);
  }
  const int64_t way = random.number(0, std::min(2 * most, far_away) * unit / largest);
  for (size_t a = 0; a < 3; ++a) {
    ray.origin[a] = random.number(0, ray.dims[a]) * unit - direction[a] * way;
    ray.direction[a] = static_cast<double>(direction[a]);
  }
}
void parallel(Random& random, TestRay& ray, int zeros, double zero) {
  for (int a = 0; a < 3; ++a) ray.origin[a] = around(random, ray.dims[a]);
  aim(random, ray);
  int first = static_cast<int>(random.number(0, 2));
  for (int k = 0; k < zeros; ++k, first = (first + 1) % 3) {
    ray.direction[first] = zero;
    ray.origin[first] = random.chance(2) ? random.number(0, ray.dims[first]) * unit  // between voxels
                                         : point(random, ray.dims[first]);
  }
}
void diagonal(Random& random, TestRay& ray) {
  Dims direction{};
  for (size_t a = 0; a < 3; ++a) direction[a] = random.sign();
  if (random.chance(3)) direction[static_cast<size_t>(random.number(0, 2))] = 0;
  back_from_corner(random, ray, direction);
}

/// Rounds components to what Frame takes.
void settle(TestRay& ray) {
  double greatest = 0;
  for (const double d : ray.direction) greatest = std::fmax(greatest, std::fabs(d));
  if (greatest == 0) ray.direction[0] = greatest = 1;
  const int exponent = std::ilogb(greatest) - 84;
  for (double& d : ray.direction)
    if (std::fabs(d) >= greatest * 0x1p-42)
      d = std::scalbn(std::nearbyint(std::scalbn(d, -exponent)), exponent);
}

}  // namespace

TestRay make_ray(Family family, const Dims& dims, Random& random) {
  TestRay ray{};
  for (size_t a = 0; a < 3; ++a) {
    ray.dims[a] = dims[a];
    ray.origin[a] = around(random, dims[a]);
  }
  const auto one_axis = [&] { return static_cast<int>(random.number(0, 2)); };
  switch (family) {
    case Family::corners: {
      const int64_t most = random.spread(1, 1000);
      Dims direction;
      for (int64_t& d : direction) d = random.number(-most, most);
      back_from_corner(random, ray, direction);
      break;
    }
    case Family::edges: {
      Dims direction;
      for (int64_t& d : direction) d = random.number(-7, 7);
      back_from_corner(random, ray, direction);
      const int along = one_axis();
      ray.origin[along] = around(random, dims[static_cast<size_t>(along)]);
      ray.direction[along] = random.either(random.mantissa() * 7);
      break;
    }
    case Family::one_axis:
      parallel(random, ray, 2, 0.0);
      break;
    case Family::two_axes:
      parallel(random, ray, 1, 0.0);
      break;
    case Family::negative_zero:
      parallel(random, ray, random.chance(2) ? 1 : 2, -0.0);
      break;
    case Family::tiny: {
      constexpr double sizes[] = {5e-324, 1e-310, 2e-308, 1e-80, 0x1p-201, 0x1p-200, 1e-40, 1e-20, 1e-10};
      parallel(random, ray, random.chance(2) ? 1 : 2, 0.0);
      double greatest = 0;  // 0x1p-200 is where components become zero, whatever the others are
      for (const double d : ray.direction) greatest = std::fmax(greatest, std::fabs(d));
      for (double& d : ray.direction)
        d = d == 0 ? random.either(sizes[random.number(0, 8)]) : d / std::exp2(std::ilogb(greatest));
      break;
    }
    case Family::faces: {
      for (size_t a = 0; a < 3; ++a) ray.origin[a] = point(random, dims[a]);
      const int axis = one_axis();
      const int64_t dim = ray.dims[axis];
      ray.origin[axis] = (random.chance(2) ? random.number(0, dim) : random.sign() > 0 ? 0 : dim) * unit;
      if (random.chance(3)) ray.origin[(axis + 1) % 3] = random.number(0, ray.dims[(axis + 1) % 3]) * unit;
      aim(random, ray);
      break;
    }
    case Family::inside:
      for (size_t a = 0; a < 3; ++a) ray.origin[a] = point(random, dims[a]);
      aim(random, ray);
      break;
    case Family::far_off: {
      for (size_t a = 0; a < 3; ++a)
        ray.origin[a] = random.number(-far_away * unit, dims[a] * unit + far_away * unit);
      const int axis = one_axis();
      ray.origin[axis] = random.chance(2) ? -far_away * unit : (ray.dims[axis] + far_away) * unit;
      aim(random, ray);
      break;
    }
    case Family::diagonal:
      diagonal(random, ray);
      break;
    case Family::near_diagonal: {
      diagonal(random, ray);
      const int axis = one_axis();
      double& d = ray.direction[axis];
      if (d != 0) d = std::nextafter(d, random.sign() * 2.0);
      if (random.chance(3)) ray.origin[(axis + 1) % 3] += random.sign();  // or one unit
      break;
    }
    case Family::random:
      aim(random, ray);
      break;
    case Family::any_direction:
      for (size_t a = 0; a < 3; ++a) {
        if (random.chance(2)) ray.origin[a] = point(random, dims[a]);
        const int exponent = -static_cast<int>(random.spread(0, 31));
        ray.direction[a] = random.either(std::scalbn(random.mantissa(), exponent));
      }
      break;
    case Family::near_ties:
      near_tie(random, Closeness::times, ray);
      break;
    case Family::near_planes:
      near_tie(random, Closeness::positions, ray);
      break;
    case Family::worst_times:
      worst_tie(random, Closeness::times, ray);
      break;
    case Family::worst_positions:
      worst_tie(random, Closeness::positions, ray);
      break;
  }
  if (family != Family::tiny && random.chance(4)) {
    const int exponent = static_cast<int>(random.number(-40, 40));
    for (double& d : ray.direction) d = std::scalbn(d, exponent);
  }
  settle(ray);
  return ray;
}

}  // namespace voxkit::stress
