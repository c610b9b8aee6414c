// Models as surfaces.
#include <gtest/gtest.h>

#include "libcolor/surface/voxel_list.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

Voxels read(SurfaceSource& source) {
  MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  Voxels voxels;
  EXPECT_TRUE(source.read(ctx, [&](std::span<const SurfaceVoxel> run) -> Status {
    voxels.insert(voxels.end(), run.begin(), run.end());
    return {};
  }));
  return voxels;
}

struct Fixture {
  MemoryBudget memory;
  Context ctx;
  Fixture() { ctx.memory = &memory; }
};

TEST(VoxelList, OfSeveralVoxelsAtOnePlaceTheLastOneStays) {
  Fixture f;
  VoxelScene scene;
  scene.voxels = {{{5, -2, 7}, {1, 2, 3}}, {{-1, 0, 7}, {4, 5, 6}}, {{5, -2, 7}, {7, 8, 9}}};
  auto surface = surface_of(std::move(scene), f.ctx);
  ASSERT_TRUE(surface);
  EXPECT_EQ((*surface)->info().dims, Index3(7, 3, 1));
  EXPECT_EQ((*surface)->info().affine.origin, (std::array<double, 3>{-0.5, -1.5, 7.5}));
  const Voxels voxels = read(**surface);
  ASSERT_EQ(voxels.size(), 2u);
  EXPECT_EQ(voxels[0].place, morton_code(0, 2, 0));
  EXPECT_EQ(voxels[0].color, (Rgb{4, 5, 6}));
  EXPECT_EQ(voxels[1].place, morton_code(6, 0, 0));
  EXPECT_EQ(voxels[1].color, (Rgb{7, 8, 9}));
}

TEST(VoxelList, WhatCannotBe) {
  Fixture f;
  EXPECT_FALSE(surface_of(VoxelScene{}, f.ctx));
}

}  // namespace
}  // namespace voxkit::color
