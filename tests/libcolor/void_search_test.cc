// Asking whether a box is void agrees with a look at each of its voxels.
#include "libcolor/dag/void_search.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "libcolor/dag/dag_builder.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

constexpr int height = 5, side = 1 << height;

struct Scene {
  const char* name;
  Voxels voxels;
};
std::vector<Scene> scenes() {
  return {{"nothing", {}},
          {"shell", sphere_shell(height)},
          {"few", scattered(height, 40, 1)},
          {"many", scattered(height, 3000, 2)},
          {"full", voxels_where(height, [](uint32_t, uint32_t, uint32_t) { return true; })}};
}

Dag build(const Voxels& voxels) {
  MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  DagBuilder builder(height, ctx);
  EXPECT_TRUE(builder.add(voxels));
  auto dag = builder.finish();
  EXPECT_TRUE(dag);
  return *std::move(dag);
}

TEST(VoidSearch, AsksAllVoxelsOfABox) {
  for (const Scene& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    const Dag dag = build(scene.voxels);
    if (dag.voxels == 0) continue;  // has no nodes to search in
    const DagView view = view_of(dag);
    std::set<uint64_t> there;
    for (const SurfaceVoxel& voxel : scene.voxels) there.insert(voxel.place);
    std::mt19937 random(3);
    for (int trial = 0; trial < 3000; ++trial) {
      uint32_t lo[3], hi[3];
      for (int a = 0; a < 3; ++a) {
        lo[a] = static_cast<uint32_t>(random()) % side;
        const uint32_t most = trial % 3 == 0 ? side : 6;
        hi[a] = lo[a] + 1 + static_cast<uint32_t>(random()) % std::min<uint32_t>(side - lo[a], most);
      }
      bool is_void = true;
      for (uint32_t z = lo[2]; z < hi[2]; ++z)
        for (uint32_t y = lo[1]; y < hi[1]; ++y)
          for (uint32_t x = lo[0]; x < hi[0]; ++x) is_void &= there.count(morton_code(x, y, z)) == 0;
      VoidSearch search(view, 1 << 20);
      ASSERT_EQ(search(lo, hi), is_void);
      ASSERT_EQ(search.found(), !is_void);
      if (!is_void) {  // where: a voxel of the box
        uint32_t at[3];
        for (int a = 0; a < 3; ++a) {
          at[a] = static_cast<uint32_t>(search.begin(a));
          ASSERT_GE(at[a], lo[a]);
          ASSERT_LT(at[a], hi[a]);
          ASSERT_EQ(search.end(a), at[a] + 1);
        }
        ASSERT_EQ(there.count(morton_code(at[0], at[1], at[2])), 1u);
      }
      VoidSearch poor(view, 2);  // says yes only where that is known
      if (poor(lo, hi)) {
        ASSERT_TRUE(is_void);
      }
    }
  }
}

}  // namespace
}  // namespace voxkit::color
