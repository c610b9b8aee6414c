// The built-in scene: voxels in order, a surface without holes, a hidden box, the same on any number of
// threads.
#include "libcolor/terrain/terrain.h"

#include <gtest/gtest.h>

#include "libcolor/terrain/house.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

struct Read {
  Index3 dims{0};
  Voxels voxels;
  Status status;
};

Read read(const std::string& name, int threads = 2, uint64_t memory_limit = 0) {
  MemoryBudget memory(memory_limit);
  Context ctx;
  ctx.memory = &memory;
  ctx.threads = threads;
  Read out;
  auto source = open_terrain(name);
  EXPECT_TRUE(source);
  out.dims = (*source)->info().dims;
  out.status = (*source)->read(ctx, [&](std::span<const SurfaceVoxel> run) -> Status {
    out.voxels.insert(out.voxels.end(), run.begin(), run.end());
    return {};
  });
  return out;
}

bool same(const Voxels& a, const Voxels& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const SurfaceVoxel& u, const SurfaceVoxel& v) {
    return u.place == v.place && u.color == v.color;
  });
}

TEST(Terrain, Names) {
  EXPECT_TRUE(is_terrain("terrain:64"));
  EXPECT_FALSE(is_terrain("terrain.ply"));
  for (const char* name :
       {"terrain:", "terrain:0", "terrain:x", "terrain:-1", "terrain:2097153", "terrain:64:", "terrain:64:bo",
        "terrain:64:box:", "terrain:64box", "terrain:64.5", "terrain:99999999999999999999"}) {
    const auto source = open_terrain(name);
    ASSERT_FALSE(source) << name;
    EXPECT_EQ(source.error().code, ErrorCode::usage) << name;
  }
  EXPECT_TRUE(open_terrain("terrain:2097152:box"));
}

TEST(Terrain, EachVoxelComesOnceInOrderInsideTheVolume) {
  for (const char* name :
       {"terrain:1", "terrain:2", "terrain:3", "terrain:64", "terrain:100", "terrain:100:box"}) {
    const Read all = read(name);
    ASSERT_TRUE(all.status) << name;
    // There is ground in every column.
    EXPECT_GE(all.voxels.size(), static_cast<size_t>(all.dims.x * all.dims.z)) << name;
    EXPECT_EQ(all.dims.x, all.dims.z);
    for (size_t i = 0; i < all.voxels.size(); ++i) {
      const auto p = morton_place(all.voxels[i].place);
      ASSERT_TRUE(p.x < all.dims.x && p.y < all.dims.y && p.z < all.dims.z) << name << ", voxel " << i;
      ASSERT_TRUE(i == 0 || all.voxels[i - 1].place < all.voxels[i].place) << name << ", voxel " << i;
    }
  }
}

/// Which voxels are reached from above, from face to face.
class Flood {
 public:
  explicit Flood(const Read& all)
      : dims_(all.dims), state_(static_cast<size_t>(dims_.x * dims_.y * dims_.z)) {
    for (const SurfaceVoxel& v : all.voxels) {
      const auto p = morton_place(v.place);
      at({p.x, p.y, p.z}) = 1;
    }
    std::vector<Index3> stack;
    const auto visit = [&](Index3 p) {
      if (!Box{Index3(0), dims_}.contains({p, p + Index3(1)}) || at(p) != 0) return;
      at(p) = 2;
      stack.push_back(p);
    };
    for (int64_t z = 0; z < dims_.z; ++z)
      for (int64_t x = 0; x < dims_.x; ++x) visit({x, dims_.y - 1, z});
    while (!stack.empty()) {
      const Index3 p = stack.back();
      stack.pop_back();
      for (int axis = 0; axis < 3; ++axis)
        for (const int64_t way : {-1, 1}) {
          Index3 next = p;
          next[axis] += way;
          visit(next);
        }
    }
  }
  bool surface(Index3 p) { return at(p) == 1; }
  bool reached(Index3 p) { return at(p) == 2; }

 private:
  uint8_t& at(Index3 p) { return state_[static_cast<size_t>((p.z * dims_.y + p.y) * dims_.x + p.x)]; }
  Index3 dims_;
  std::vector<uint8_t> state_;
};

TEST(Terrain, GroundWallsAndRoofsHaveNoHoles) {
  for (const int64_t n : {90, 256}) {
    const Read all = read("terrain:" + std::to_string(n));
    ASSERT_TRUE(all.status);
    Flood flood(all);
    // The floor of the world, below all ground.
    int64_t reached = 0;
    for (int64_t z = 0; z < n; ++z)
      for (int64_t x = 0; x < n; ++x) reached += flood.reached({x, 0, z});
    EXPECT_EQ(reached, 0) << n;
    // Inside of houses: from the ridge down to the floor of the world.
    for (const terrain::House& house : terrain::planned_houses()) {
      const int64_t x = house.x * n / terrain::side, z = house.z * n / terrain::side;
      int64_t y = all.dims.y - 1;
      while (y > 0 && !flood.surface({x, y, z})) --y;
      EXPECT_GT(y, n * 8 / 128) << n;
      for (; y >= 0; --y) EXPECT_FALSE(flood.reached({x, y, z})) << n << ", " << y;
    }
  }
}

TEST(Terrain, TheBoxIsBlackAndHidden) {
  const Read without = read("terrain:256"), with = read("terrain:256:box");
  ASSERT_TRUE(without.status && with.status);
  EXPECT_EQ(with.dims, without.dims);
  Voxels box, rest;
  Index3 lo(INT32_MAX), hi(0);
  size_t i = 0;
  for (const SurfaceVoxel& v : with.voxels) {
    if (i < without.voxels.size() && without.voxels[i].place == v.place) {
      rest.push_back(v), ++i;
      continue;
    }
    box.push_back(v);
    EXPECT_EQ(v.color, Rgb{});
    const auto p = morton_place(v.place);
    for (int a = 0; a < 3; ++a) {
      lo[a] = std::min<int64_t>(lo[a], p[a]);
      hi[a] = std::max<int64_t>(hi[a], p[a]);
    }
  }
  // All that was there is there, as it was.
  EXPECT_TRUE(same(rest, without.voxels));
  const double share = static_cast<double>(box.size()) / static_cast<double>(with.voxels.size());
  EXPECT_GT(share, 0.4);
  EXPECT_LT(share, 0.6);
  // It is closed: a path from its inside does not lead up.
  Flood flood(with);
  const Index3 inside = (lo + hi) / int64_t{2};
  EXPECT_FALSE(flood.surface(inside));
  EXPECT_FALSE(flood.reached(inside));
}

TEST(Terrain, TheSameOnAnyNumberOfThreadsAndInLittleMemory) {
  const Read one = read("terrain:200:box", 1), three = read("terrain:200:box", 3);
  const Read small = read("terrain:200:box", 2, uint64_t{160} << 20);
  ASSERT_TRUE(one.status && three.status && small.status);
  EXPECT_TRUE(same(one.voxels, three.voxels));
  EXPECT_TRUE(same(one.voxels, small.voxels));
  const Read none = read("terrain:200", 1, uint64_t{1} << 20);
  ASSERT_FALSE(none.status);
  EXPECT_EQ(none.status.error().code, ErrorCode::limit);
}

TEST(Terrain, MoreVoxelsShowTheSameScene) {
  // The mean colour of what is seen from above, of the same places.
  const auto map = [](int64_t n) {
    const Read all = read("terrain:" + std::to_string(n));
    std::vector<std::array<int64_t, 4>> top(static_cast<size_t>(n * n));
    for (const SurfaceVoxel& v : all.voxels) {
      const auto p = morton_place(v.place);
      auto& cell = top[p.z * static_cast<size_t>(n) + p.x];
      if (p.y >= cell[3]) cell = {v.color.r, v.color.g, v.color.b, p.y};
    }
    constexpr int64_t places = 16;
    std::vector<std::array<int64_t, 4>> means(places * places);
    const int64_t count = n / places;
    for (int64_t z = 0; z < n; ++z)
      for (int64_t x = 0; x < n; ++x)
        for (size_t c = 0; c < 4; ++c)
          means[static_cast<size_t>(z / count * places + x / count)][c] +=
              top[static_cast<size_t>(z * n + x)][c];
    for (auto& mean : means) {
      for (size_t c = 0; c < 3; ++c) mean[c] /= count * count;
      mean[3] = mean[3] * 12800 / (n * count * count);  // in centimetres
    }
    return means;
  };
  const auto coarse = map(256), fine = map(1024);
  for (size_t i = 0; i < coarse.size(); ++i) {
    for (size_t c = 0; c < 3; ++c)
      EXPECT_LE(std::abs(coarse[i][c] - fine[i][c]), 24)
          << i << " channel " << c << ": " << coarse[i][c] << " and " << fine[i][c] << ", heights "
          << coarse[i][3] << " " << fine[i][3];
    EXPECT_LE(std::abs(coarse[i][3] - fine[i][3]), 120) << i;
  }
}

}  // namespace
}  // namespace voxkit::color
