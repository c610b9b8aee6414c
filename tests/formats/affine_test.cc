#include "formats/affine.h"

#include <gtest/gtest.h>

#include <cstring>

#include "formats/orient.h"
#include "tests/memory_volume.h"

namespace voxkit {
namespace {

using Vector = Affine::Vector;

TEST(Affine, AxesAlongTheWorldHaveTheirLengthsExactly) {
  const Affine plain = Affine::plain({0.1, 0.7, 3}, {1, 2, 3});
  EXPECT_TRUE(plain.is_plain());
  EXPECT_TRUE(plain.is_valid());
  EXPECT_EQ(plain.spacing(), (Vector{0.1, 0.7, 3}));
  Affine turned = plain;
  turned.axes = {{{0, -0.1, 0}, {0, 0, 0.7}, {3, 0, 0}}};
  EXPECT_EQ(turned.spacing(), (Vector{0.1, 0.7, 3}));
  EXPECT_FALSE(turned.is_plain());
  EXPECT_LT(turned.determinant() * plain.determinant(), 0);
}

TEST(Affine, FlatAndInfiniteAxesAreNotValid) {
  Affine flat;
  flat.axes[2] = {1, 1, 0};
  EXPECT_FALSE(flat.is_valid());
  Affine infinite;
  infinite.origin[1] = 1.0 / 0.0;
  EXPECT_FALSE(infinite.is_valid());
  EXPECT_TRUE(Affine::plain({1e-200, 1e-200, 1e-200}, {0, 0, 0}).is_valid());
}

TEST(Affine, PartsAndCoarserVolumesStayWhereTheyAre) {
  Affine at;
  at.axes = {{{0, 2, 0}, {-3, 0, 1}, {0.5, 0, 4}}};
  at.origin = {10, 20, 30};
  EXPECT_EQ(at.moved_to({1, 2, 3}).origin, at.place({1, 2, 3}));
  // The outer corner, half a voxel before the first centre, is the same.
  EXPECT_EQ(at.coarser({2, 4, 8}).place({-0.5, -0.5, -0.5}), at.place({-0.5, -0.5, -0.5}));
  EXPECT_EQ(at.coarser({2, 4, 8}).place({0.5, 0.5, 0.5}), at.place({1.5, 3.5, 7.5}));
}

TEST(Affine, WorldsDifferInSigns) {
  const Affine ras = Affine::plain({1, 2, 3}, {4, 5, 0});
  const Affine lps = in_world(ras, World::ras, World::lps);
  EXPECT_EQ(lps.axes[0][0], -1);
  EXPECT_EQ(lps.axes[1][1], -2);
  EXPECT_EQ(lps.axes[2][2], 3);
  EXPECT_EQ(lps.origin, (Vector{-4, -5, 0}));
  EXPECT_EQ(in_world(lps, World::lps, World::ras), ras);
  EXPECT_EQ(orientation(ras, World::ras), "RAS");
  EXPECT_EQ(orientation(ras, World::lps), "LPS");
  EXPECT_EQ(orientation(lps, World::unknown), "-x-y+z");
}

TEST(Affine, UnitsByManyNames) {
  EXPECT_EQ(parse_unit("micron"), Unit::micrometre);
  EXPECT_EQ(parse_unit("\xc2\xb5m"), Unit::micrometre);
  EXPECT_EQ(parse_unit("MM"), Unit::millimetre);
  EXPECT_EQ(parse_unit("furlong"), std::nullopt);
  for (const Unit unit : {Unit::metre, Unit::centimetre, Unit::millimetre, Unit::micrometre, Unit::nanometre,
                          Unit::angstrom, Unit::inch})
    EXPECT_EQ(parse_unit(name(unit)), unit);
}

/// Every order and direction of axes: each voxel keeps its place, and its value.
TEST(Orient, NoVoxelMoves) {
  Context ctx;
  MemoryBudget budget;
  ctx.memory = &budget;
  for (const auto& from :
       {std::array<int, 3>{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}})
    for (int flips = 0; flips < 8; ++flips) {
      const AxisOrder order{from, {(flips & 1) != 0, (flips & 2) != 0, (flips & 4) != 0}};
      VolumeInfo info;
      info.dims = {5, 3, 4};
      info.format = VoxelFormat::density16;
      info.sample_type = SampleType::u16;
      info.affine.axes = {{{0.5, 0.25, 0}, {0, 2, 0.125}, {0, 1, -3}}};
      info.affine.origin = {7, -8, 9};
      std::vector<std::byte> voxels(5 * 3 * 4 * 2);
      for (int i = 0; i < 5 * 3 * 4; ++i) {
        const auto value = static_cast<uint16_t>(i % 5 + 10 * (i / 5 % 3) + 100 * (i / 15));
        std::memcpy(&voxels[static_cast<size_t>(2 * i)], &value, 2);
      }
      auto made = reordered(std::make_unique<test::MemorySource>(info, voxels), order, ctx);
      ASSERT_TRUE(made) << made.error().what;
      const VolumeInfo& now = (*made)->info();
      for (int64_t z = 0; z < now.dims.z; ++z)
        for (int64_t y = 0; y < now.dims.y; ++y)
          for (int64_t x = 0; x < now.dims.x; ++x) {
            uint16_t value = 0;
            ASSERT_TRUE((*made)->read({{x, y, z}, {x + 1, y + 1, z + 1}},
                                      {reinterpret_cast<std::byte*>(&value), 0, 0}));
            const Vector was =
                info.affine.place({double(value % 10), double(value / 10 % 10), double(value / 100)});
            const Vector is = now.affine.place({double(x), double(y), double(z)});
            for (size_t a = 0; a < 3; ++a) ASSERT_EQ(is[a], was[a]);
          }
    }
}

TEST(Orient, LettersNameThePatientsSides) {
  VolumeInfo info;
  info.world = World::lps;
  info.affine.axes = {{{0, 0, 1}, {-1, 0, 0.1}, {0, 1, 0}}};  // SRP
  EXPECT_EQ(orientation(info.affine, info.world), "SRP");
  const auto order = order_for("RAS", info);
  ASSERT_TRUE(order) << order.error().what;
  EXPECT_EQ(order->from, (std::array<int, 3>{1, 2, 0}));
  EXPECT_EQ(order->reversed, (std::array<bool, 3>{false, true, false}));
  EXPECT_EQ(order_for("canonical", info)->from, order->from);
  for (const char* wrong : {"", "RA", "RLS", "RASX", "ras", "XYZ"})
    EXPECT_FALSE(order_for(wrong, info)) << wrong;
  info.world = World::unknown;
  EXPECT_FALSE(order_for("RAS", info));
  EXPECT_TRUE(order_for("canonical", info));
}

}  // namespace
}  // namespace voxkit
