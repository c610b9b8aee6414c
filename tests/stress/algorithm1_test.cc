// The stress test's copy of Algorithm 1 against the renderer's.
#include "tests/stress/algorithm1.h"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <vector>

#include "librender/cast/cast_kernel.h"

namespace voxkit::stress {
namespace {

using Voxel3 = std::array<int64_t, 3>;

struct Volume {
  explicit Volume(const Voxel3& size)
      : dims(size), voxels(static_cast<size_t>(size[0] * size[1] * size[2])) {}
  std::byte& at(const Voxel3& v) {
    return voxels[static_cast<size_t>((v[2] * dims[1] + v[1]) * dims[0] + v[0])];
  }
  Voxel3 dims;
  std::vector<std::byte> voxels;
};

struct Seen {
  render::Pixel pixel;
  render::PixelDetail detail;
};
/// What the renderer sees along one ray.
Seen look(const Volume& volume, const double (&origin)[3], const double (&direction)[3]) {
  const int64_t dims[3] = {volume.dims[0], volume.dims[1], volume.dims[2]};
  render::CastParams params{
      .width = 1,
      .height = 1,
      .left = 0,
      .top = 0,
      .right = 1,
      .bottom = 1,
      .dims = {dims[0], dims[1], dims[2]},
      .origin = {origin[0], origin[1], origin[2]},
      .start = render::RayOrigin(origin, dims),
      .corner = {direction[0], direction[1], direction[2]},
      .across = {},
      .down = {},
      .pixel = 0,
      .edge = 1,
      .cone = 0,
      .coarsest = 0,
      .skip = false,
      .color_of = render::ColorOf(VoxelFormat::density8, {0, 255}),
  };
  const render::DenseView view{volume.voxels.data(), dims[0], dims[1], 1};
  auto cursor = view.cursor();
  Seen seen;
  render::follow_baseline(params, cursor, 0, 0, seen.pixel, seen.detail);
  return seen;
}

TEST(Algorithm1, IsThatOfTheRenderer) {
  std::mt19937_64 random(1);
  const auto number = [&](int64_t lo, int64_t hi) {
    return lo + static_cast<int64_t>(random() % static_cast<uint64_t>(hi - lo + 1));
  };
  int hits = 0;
  for (int trial = 0; trial < 5000; ++trial) {
    Volume volume({number(1, 24), number(1, 24), number(1, 24)});
    const int64_t dims[3] = {volume.dims[0], volume.dims[1], volume.dims[2]};
    double origin[3], direction[3];
    const bool lattice = number(0, 3) == 0;  // ties and zeros
    for (int a = 0; a < 3; ++a) {
      origin[a] =
          static_cast<double>(number(-40 * 1024, 64 * 1024) / (lattice ? 1024 : 1)) / (lattice ? 1 : 1024);
      direction[a] = lattice ? static_cast<double>(number(-2, 2))
                             : static_cast<double>(number(0, dims[a] * 1024)) / 1024 - origin[a];
    }
    Algorithm1 ray;
    std::vector<Voxel3> visited;
    std::vector<float> entered;
    for (bool inside = ray.enter(origin, direction, dims); inside; inside = ray.step()) {
      visited.push_back({ray.voxel(0), ray.voxel(1), ray.voxel(2)});
      entered.push_back(ray.t());
      ASSERT_LT(visited.size(), 100u);
    }
    ASSERT_EQ(look(volume, origin, direction).detail.cells, visited.size()) << "trial " << trial;
    if (visited.empty()) continue;
    ++hits;
    const auto k = static_cast<size_t>(number(0, static_cast<int64_t>(visited.size()) - 1));
    volume.at(visited[k]) = std::byte{255};
    const Seen seen = look(volume, origin, direction);
    // If the whole of it is crossed, an opaque voxel is the last one.
    const Voxel3 found = {seen.detail.voxel[0], seen.detail.voxel[1], seen.detail.voxel[2]};
    ASSERT_EQ(found, visited[k]) << "trial " << trial;
    ASSERT_EQ(seen.pixel.distance, entered[k]) << "trial " << trial;
    ASSERT_EQ(seen.detail.cells, k + 1) << "trial " << trial;
  }
  EXPECT_GT(hits, 2000);
}

}  // namespace
}  // namespace voxkit::stress
