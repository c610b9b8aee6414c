// Models and points as surfaces.
#include <gtest/gtest.h>

#include <cmath>

#include "libcolor/voxel_list.h"
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
  EXPECT_EQ((*surface)->info().origin, (std::array<double, 3>{-0.5, -1.5, 7.5}));
  const Voxels voxels = read(**surface);
  ASSERT_EQ(voxels.size(), 2u);
  EXPECT_EQ(voxels[0].place, morton_code(0, 2, 0));
  EXPECT_EQ(voxels[0].color, (Rgb{4, 5, 6}));
  EXPECT_EQ(voxels[1].place, morton_code(6, 0, 0));
  EXPECT_EQ(voxels[1].color, (Rgb{7, 8, 9}));
}

TEST(VoxelList, PointsOfAVoxelAreAveragedInLinearLight) {
  Fixture f;
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {0.1, 0.2, 0.05}, {8, 2, 1}};
  mesh.colors = {{1, 0, 0, 1}, {0, 0, 0, 1}, {0, 1, 0, 1}};
  auto surface = surface_of_points(std::move(mesh), 8, f.ctx);
  ASSERT_TRUE(surface) << surface.error().what;
  EXPECT_EQ((*surface)->info().dims, Index3(8, 3, 2));
  const Voxels voxels = read(**surface);
  ASSERT_EQ(voxels.size(), 2u);
  EXPECT_EQ(voxels[0].color, (Rgb{188, 0, 0}));
  EXPECT_EQ(voxels[1].place, morton_code(7, 2, 1));
  EXPECT_EQ(voxels[1].color, (Rgb{0, 255, 0}));
}

TEST(VoxelList, WhatCannotBe) {
  Fixture f;
  EXPECT_FALSE(surface_of(VoxelScene{}, f.ctx));
  Mesh mesh;
  EXPECT_FALSE(surface_of_points(Mesh{}, 8, f.ctx));
  mesh.positions = {{0, 0, 0}, {NAN, 0, 0}};
  const auto bad = surface_of_points(std::move(mesh), 8, f.ctx);
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().code, ErrorCode::input);
  Mesh one;
  one.positions = {{3, 4, 5}};
  EXPECT_FALSE(surface_of_points(std::move(one), 0, f.ctx));
  Mesh again;
  again.positions = {{3, 4, 5}};
  auto point = surface_of_points(std::move(again), 1000, f.ctx);
  ASSERT_TRUE(point);
  EXPECT_EQ((*point)->info().dims, Index3(1));
  EXPECT_EQ(read(**point).size(), 1u);
}

}  // namespace
}  // namespace voxkit::color
