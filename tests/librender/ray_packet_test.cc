// Rays side by side go where each goes alone.
#include "librender/cast/ray_packet.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "librender/cast/cast_params.h"

namespace voxkit::render {
namespace {

struct Box {
  uint32_t lo[3], hi[3];
};

/// Follows the rays of a packet through random boxes that cover the grid, cut at `cuts`, beside GridRay.
template <int width, int height>
void expect_same(const CastParams& params, int x, int y, const std::vector<uint32_t> (&cuts)[3], int& packets,
                 int& moves, int& alone) {
  const Mirrored first(ray_through(params, x, y).direction);
  for (int i = 0; i < width * height; ++i)
    if (!(Mirrored(ray_through(params, x + i % width, y + i / width).direction) == first)) return;
  ++packets;
  const Mirror mirror(params, first);
  RayPacket<width, height> rays(params, mirror, x, y);
  for (int i = 0; i < width * height; ++i) {
    GridRay ray(params.start, ray_through(params, x + i % width, y + i / width).direction);
    if (!rays.entered(i)) {
      ++alone;
      continue;
    }
    const auto box_around = [&](const uint32_t(&v)[3]) {
      Box box;
      for (int a = 0; a < 3; ++a) {
        const auto next = std::upper_bound(cuts[a].begin(), cuts[a].end(), v[a]);
        box.hi[a] = *next;
        box.lo[a] = *(next - 1);
      }
      return box;
    };
    // Those before it may have taken it along already.
    bool inside = ray.enter();
    for (uint32_t passed = 0; passed < rays.passed(i); ++passed) {
      ASSERT_TRUE(inside);
      const Box box = box_around({ray.voxel(0), ray.voxel(1), ray.voxel(2)});
      inside = ray.leave(box.lo, box.hi);
    }
    while (rays.moving(i)) {
      ASSERT_TRUE(inside);
      ASSERT_EQ(rays.t(i), ray.t());
      uint32_t v[3];
      for (int a = 0; a < 3; ++a) {
        v[a] = mirror.voxel(a, rays.voxel(i, a));
        ASSERT_EQ(v[a], ray.voxel(a));
      }
      const Box box = box_around(v);
      ASSERT_TRUE(rays.leave(mirror(box.lo, box.hi)));
      if (!rays.moving(i) && !rays.gone(i)) break;  // unclear: it has not moved
      inside = ray.leave(box.lo, box.hi);
      ++moves;
    }
    ASSERT_EQ(rays.gone(i), !inside);
    if (rays.gone(i)) continue;
    ++alone;
    GridRay resumed(params.start, ray_through(params, x + i % width, y + i / width).direction);
    uint32_t v[3];
    for (int a = 0; a < 3; ++a) v[a] = mirror.voxel(a, rays.voxel(i, a));
    resumed.resume(rays.t(i), v);
    ASSERT_EQ(resumed.t(), ray.t());
    for (int a = 0; a < 3; ++a) ASSERT_EQ(resumed.voxel(a), ray.voxel(a));
  }
}

TEST(RayPacket, GoesWhereItsRaysGo) {
  std::mt19937 random(3);
  const auto number = [&](double lo, double hi) {
    return std::uniform_real_distribution<double>(lo, hi)(random);
  };
  int packets = 0, moves = 0, alone = 0;
  for (int trial = 0; trial < 300; ++trial) {
    VolumeInfo info;
    info.format = VoxelFormat::density8;
    std::vector<uint32_t> cuts[3];
    for (int a = 0; a < 3; ++a) {
      info.dims[a] = 1 + static_cast<int64_t>(random() % (trial % 2 == 0 ? 40 : 3000));
      cuts[a] = {0, static_cast<uint32_t>(info.dims[a])};
      for (int k = 0; k < 6; ++k) cuts[a].push_back(static_cast<uint32_t>(random()) % cuts[a][1]);
      std::sort(cuts[a].begin(), cuts[a].end());
    }
    // From afar, from inside, and along the axes, where planes are crossed at once.
    Camera camera;
    camera.eye = trial % 3 == 0 ? glm::dvec3(number(-0.3, 0.3), number(-0.3, 0.3), number(-0.3, 0.3))
                                : glm::dvec3(number(-2, 2), number(-2, 2), number(-2, 2));
    if (trial % 5 == 0) camera.eye = {0, 0, 2};
    camera.target = {0, 0, 0};
    CastOptions options;
    options.width = 8, options.height = 8;
    const auto params = cast_params(info, camera, options);
    ASSERT_TRUE(params);
    for (int y = 0; y < 8; y += 2)
      for (int x = 0; x < 8; x += 2) {
        expect_same<2, 2>(*params, x, y, cuts, packets, moves, alone);
        expect_same<2, 1>(*params, x, y + 1, cuts, packets, moves, alone);
        if (HasFatalFailure()) FAIL() << "trial " << trial;
      }
  }
  EXPECT_GT(packets, 5000);
  EXPECT_GT(moves, 20000);
  EXPECT_GT(alone, 10);
}

}  // namespace
}  // namespace voxkit::render
