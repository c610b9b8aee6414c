// Rays against a reference in integers: which voxels, in which order, and that steps over cells of any size
// land in the same ones.
#include "librender/cast/ray.h"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <vector>

namespace voxkit::render {
namespace {

using Int = __int128;
using Voxel3 = std::array<int64_t, 3>;

/// An exact ray: origin in 1/1024 voxels, direction in integers.
struct ExactRay {
  std::array<int64_t, 3> origin, direction, dims;
};
constexpr int64_t unit = 1024;

/// The voxels that the ray visits, by comparing fractions of integers; mirrored so that no direction is
/// negative.
std::vector<Voxel3> reference(const ExactRay& ray, size_t most) {
  Voxel3 o = ray.origin, d = ray.direction;
  std::array<bool, 3> mirrored{};
  for (size_t a = 0; a < 3; ++a)
    if (d[a] < 0) mirrored[a] = true, d[a] = -d[a], o[a] = ray.dims[a] * unit - o[a];
  // (p * unit - o_a) / d_a < (q * unit - o_b) / d_b, ties to the lower axis
  const auto before = [&](size_t a, int64_t p, size_t b, int64_t q) {
    const Int left = (Int(p) * unit - o[a]) * d[b], right = (Int(q) * unit - o[b]) * d[a];
    return left != right ? left < right : a < b;
  };
  const auto floor_div = [](int64_t x, int64_t y) { return x >= 0 ? x / y : -((-x + y - 1) / y); };
  Voxel3 v;
  for (size_t a = 0; a < 3; ++a) v[a] = floor_div(o[a], unit);
  std::vector<Voxel3> visited;
  for (;;) {
    bool inside = true, gone = false;
    for (size_t a = 0; a < 3; ++a) {
      inside &= v[a] >= 0 && v[a] < ray.dims[a];
      gone |= v[a] >= ray.dims[a] || (v[a] < 0 && d[a] == 0);
    }
    if (gone || visited.size() == most) return visited;
    if (inside) {
      Voxel3 out = v;
      for (size_t a = 0; a < 3; ++a)
        if (mirrored[a]) out[a] = ray.dims[a] - 1 - out[a];
      visited.push_back(out);
    }
    size_t axis = 3;
    for (size_t a = 0; a < 3; ++a)
      if (d[a] > 0 && (axis == 3 || before(a, v[a] + 1, axis, v[axis] + 1))) axis = a;
    ++v[axis];
  }
}

GridRay make(const ExactRay& ray) {
  double o[3], d[3];
  int64_t dims[3];
  for (size_t a = 0; a < 3; ++a) {
    o[a] = static_cast<double>(ray.origin[a]) / unit;
    d[a] = static_cast<double>(ray.direction[a]) * 0.25;
    dims[a] = ray.dims[a];
  }
  const RayOrigin origin(o, dims);
  return GridRay(origin, d);
}

Voxel3 voxel_of(const GridRay& ray) {
  return {ray.voxel(0), ray.voxel(1), ray.voxel(2)};
}

/// Random rays, among them many through corners and edges of voxels, along planes, parallel to axes, from
/// inside and from afar.
ExactRay random_ray(std::mt19937_64& random, int64_t largest) {
  ExactRay ray;
  const auto number = [&](int64_t lo, int64_t hi) {
    return lo + static_cast<int64_t>(random() % static_cast<uint64_t>(hi - lo + 1));
  };
  const int kind = static_cast<int>(number(0, 5));
  for (size_t a = 0; a < 3; ++a) {
    ray.dims[a] = number(1, largest);
    ray.origin[a] = number(-2 * ray.dims[a] * unit, 3 * ray.dims[a] * unit);
    ray.direction[a] = number(-1 << 20, 1 << 20);
    if (kind == 1)
      ray.origin[a] = ray.origin[a] / unit * unit, ray.direction[a] = number(-3, 3);  // lattice corners
    if (kind == 2 && number(0, 1)) ray.direction[a] = 0;                              // parallel to axes
    if (kind == 3) ray.origin[a] = number(0, ray.dims[a]) * unit;                     // on faces
    if (kind == 4) ray.direction[a] = number(-1, 1) * (int64_t{1} << number(0, 20));  // steep, ties
    if (kind == 5) ray.origin[a] = number(0, ray.dims[a] * unit - 1);                 // inside
  }
  if (kind != 5 && kind != 3)  // aimed at the volume, mostly
    for (size_t a = 0; a < 3 && kind == 0; ++a)
      ray.direction[a] = number(0, ray.dims[a] * unit) - ray.origin[a];
  if (ray.direction == std::array<int64_t, 3>{}) ray.direction[0] = 1;
  return ray;
}

TEST(GridRay, VisitsExactlyTheVoxelsOfTheReference) {
  std::mt19937_64 random(1);
  int64_t steps = 0, hits = 0;
  for (int trial = 0; trial < 40000; ++trial) {
    const ExactRay exact = random_ray(random, trial % 10 ? 40 : 3000);
    const auto want = reference(exact, 4000);
    GridRay ray = make(exact);
    double last = 0;
    bool inside = ray.enter();
    ASSERT_EQ(inside, !want.empty()) << "trial " << trial;
    hits += inside;
    for (const Voxel3& v : want) {
      ASSERT_TRUE(inside) << "trial " << trial;
      ASSERT_EQ(voxel_of(ray), v) << "trial " << trial << " step " << steps;
      ASSERT_GE(ray.t(), last * (1 - 1e-15));
      last = ray.t();
      inside = ray.leave(0);
      ++steps;
    }
    if (want.size() < 4000) {
      ASSERT_FALSE(inside);
    }
  }
  EXPECT_GT(hits, 10000);
  EXPECT_GT(steps, 500000);
}

TEST(GridRay, StepsOverCellsLandWhereSingleStepsDo) {
  std::mt19937_64 random(2);
  for (int trial = 0; trial < 40000; ++trial) {
    const ExactRay exact = random_ray(random, 200);
    const auto single = reference(exact, 100000);
    GridRay ray = make(exact);
    bool inside = ray.enter();
    size_t at = 0;
    while (inside) {
      ASSERT_LT(at, single.size());
      ASSERT_EQ(voxel_of(ray), single[at]) << "trial " << trial;
      // An aligned cube around the voxel, or any box; both cut to the grid.
      const bool cube = random() % 2 == 0;
      const int log2_edge = static_cast<int>(random() % 6);
      uint32_t lo[3], hi[3];
      for (size_t a = 0; a < 3; ++a) {
        const auto v = static_cast<uint32_t>(single[at][a]), dim = static_cast<uint32_t>(exact.dims[a]);
        lo[a] = cube ? v >> log2_edge << log2_edge : v - static_cast<uint32_t>(random() % (v + 1));
        hi[a] = cube ? std::min(lo[a] + (1u << log2_edge), dim)
                     : v + 1 + static_cast<uint32_t>(random() % (dim - v));
      }
      const auto in_cell = [&](const Voxel3& v) {
        return v[0] >= lo[0] && v[1] >= lo[1] && v[2] >= lo[2] && v[0] < hi[0] && v[1] < hi[1] &&
               v[2] < hi[2];
      };
      while (at < single.size() && in_cell(single[at])) ++at;
      inside = cube ? ray.leave(log2_edge) : ray.leave(lo, hi);
    }
    ASSERT_EQ(at, single.size()) << "trial " << trial;
  }
}

TEST(GridRay, ExtremeDirections) {
  const int64_t dims[3] = {1 << 20, 1 << 20, 1 << 20};
  for (const double tiny : {0.0, -0.0, 1e-310, -5e-324, 1e-80}) {
    const double o[3] = {-1000000.0, 3.5, 7.0}, d[3] = {1, tiny, tiny};
    const RayOrigin origin(o, dims);
    GridRay ray(origin, d);
    ASSERT_TRUE(ray.enter());
    EXPECT_EQ(ray.t(), 1000000.0);
    EXPECT_EQ(voxel_of(ray)[1], 3);
    EXPECT_FALSE(ray.leave(20));
    EXPECT_EQ(ray.t(), 1000000.0 + (1 << 20));
  }
}

}  // namespace
}  // namespace voxkit::render
