// Voxels of triangles against a test of every voxel.
#include <gtest/gtest.h>

#include <random>
#include <set>

#include "tests/libcolor/voxelise_reference.h"

namespace voxkit::color {
namespace {

std::set<uint64_t> cells(const SnappedTriangle& triangle, SurfaceKind kind, const Cube& cube) {
  std::set<uint64_t> codes;
  TriangleCells(triangle, kind)
      .each_cell(
          cube, [] {},
          [&](uint64_t code) { EXPECT_TRUE(codes.insert(code).second) << "a voxel comes twice"; });
  return codes;
}

std::set<uint64_t> reference(const SnappedTriangle& triangle, SurfaceKind kind, const Cube& cube) {
  const ReferenceCells all(triangle);
  std::set<uint64_t> codes;
  for (uint32_t z = 0; z < 1u << cube.bits; ++z)
    for (uint32_t y = 0; y < 1u << cube.bits; ++y)
      for (uint32_t x = 0; x < 1u << cube.bits; ++x)
        if (all.in(kind, cube.lo[0] + x, cube.lo[1] + y, cube.lo[2] + z)) codes.insert(morton_code(x, y, z));
  return codes;
}

void expect_same(const SnappedTriangle& triangle, const Cube& cube) {
  for (const SurfaceKind kind : {SurfaceKind::thin, SurfaceKind::conservative}) {
    const auto want = reference(triangle, kind, cube);
    const auto have = cells(triangle, kind, cube);
    ASSERT_EQ(have, want) << (kind == SurfaceKind::thin ? "thin" : "conservative") << " triangle "
                          << testing::PrintToString(triangle.corners) << " cube "
                          << testing::PrintToString(cube.lo) << " " << cube.bits;
    EXPECT_TRUE(want.empty() || TriangleCells(triangle, kind).touches(cube));
  }
}

class CellsTest : public testing::Test {
 protected:
  /// An odd number below 512 * side.
  int32_t place(int side) {
    return static_cast<int32_t>(random_() % (256u * static_cast<unsigned>(side))) * 2 + 1;
  }
  std::array<int32_t, 3> point(int side) { return {place(side), place(side), place(side)}; }
  std::mt19937 random_{5};
};

TEST_F(CellsTest, RandomTriangles) {
  for (int i = 0; i < 300; ++i) expect_same({{point(16), point(16), point(16)}}, {{0, 0, 0}, 4});
  for (int i = 0; i < 6; ++i) expect_same({{point(64), point(64), point(64)}}, {{0, 0, 0}, 6});
}

TEST_F(CellsTest, SmallTriangles) {
  for (int i = 0; i < 2000; ++i) {
    const auto first = point(6);
    SnappedTriangle triangle{{first, first, first}};
    const int size = 1 << random_() % 11;
    for (size_t corner = 1; corner < 3; ++corner)
      for (size_t c = 0; c < 3; ++c)
        triangle.corners[corner][c] = std::clamp(
            first[c] + 2 * (static_cast<int32_t>(random_() % static_cast<unsigned>(size)) - size / 2), 1,
            8 * 512 - 1);
    expect_same(triangle, {{0, 0, 0}, 3});
  }
}

TEST_F(CellsTest, SliversAndLines) {
  for (int i = 0; i < 300; ++i) {
    SnappedTriangle triangle{{point(16), point(16), point(16)}};
    for (size_t c = 0; c < 3; ++c) {
      const int32_t between = (triangle.corners[0][c] + triangle.corners[1][c]) / 2 | 1;
      triangle.corners[2][c] = std::min(between + 2 * static_cast<int32_t>(random_() % 2), 16 * 512 - 1);
    }
    expect_same(triangle, {{0, 0, 0}, 4});
    if (i % 3 == 0) triangle.corners[2] = triangle.corners[1];
    if (i % 9 == 0) triangle.corners[1] = triangle.corners[2] = triangle.corners[0];
    expect_same(triangle, {{0, 0, 0}, 4});
  }
}

TEST_F(CellsTest, AlongAxesAndDiagonals) {
  // Corners at the first, the middle and the last step of voxels, and planes x = c, x + y = c, x + y + z = c.
  const int32_t steps[] = {1, 255, 257, 511};
  for (int i = 0; i < 600; ++i) {
    SnappedTriangle triangle;
    for (auto& corner : triangle.corners)
      for (int32_t& c : corner) c = static_cast<int32_t>(random_() % 8) * 512 + steps[random_() % 4];
    const size_t axis = i % 3;
    const int32_t level = triangle.corners[0][axis];
    for (auto& corner : triangle.corners) {
      if (i % 4 == 0) corner[axis] = level;
      if (i % 4 == 1) corner[axis] = std::clamp(4096 - corner[(axis + 1) % 3], 1, 4095);
      if (i % 4 == 2)
        corner[axis] =
            std::clamp((4096 + level) / 2 * 2 + 1 - corner[(axis + 1) % 3] - corner[(axis + 2) % 3] + 1, 1,
                       4095) |
            1;
    }
    expect_same(triangle, {{0, 0, 0}, 3});
  }
}

TEST_F(CellsTest, AxisAlignedPlanesAreOneVoxelThick) {
  for (int32_t level = 1; level < 4 * 512; level += 2)
    for (size_t axis = 0; axis < 3; ++axis)
      for (const SurfaceKind kind : {SurfaceKind::thin, SurfaceKind::conservative}) {
        SnappedTriangle triangle{{{{1, 1, 1}, {4 * 512 - 1, 1, 1}, {1, 4 * 512 - 1, 1}}}};
        for (auto& corner : triangle.corners) {
          std::rotate(corner.begin(), corner.begin() + 2 - static_cast<ptrdiff_t>(axis), corner.end());
          corner[axis] = level;
        }
        for (const uint64_t code : cells(triangle, kind, {{0, 0, 0}, 2}))
          EXPECT_EQ(morton_place(code)[static_cast<int>(axis)], static_cast<uint32_t>(level / 512));
      }
}

/// Large triangles at the end of the range, looked at in cubes of 8^3 that they pass through.
TEST_F(CellsTest, LargestCoordinates) {
  constexpr int side = 1 << 21;
  int found = 0;
  for (int i = 0; i < 400; ++i) {
    // From 2^12 to all of the range: both widths of numbers.
    const int range = i % 2 ? side : 1 << (12 + random_() % 9);
    const int32_t shift = (side - range) * 512;
    SnappedTriangle triangle{{point(range), point(range), point(range)}};
    for (auto& corner : triangle.corners)
      for (int32_t& c : corner) c += i % 4 < 2 ? shift : 0;
    // Around a point of the triangle.
    double a = static_cast<double>(random_() % 1000) / 1000, b = static_cast<double>(random_() % 1000) / 1000;
    if (a + b > 1) a = 1 - a, b = 1 - b;
    if (i % 5 == 0) b = 0;
    Cube cube{{}, 3};
    for (size_t c = 0; c < 3; ++c) {
      const double at = triangle.corners[0][c] + a * (triangle.corners[1][c] - triangle.corners[0][c]) +
                        b * (triangle.corners[2][c] - triangle.corners[0][c]);
      cube.lo[c] = static_cast<int32_t>(at) / 512 / 8 * 8;
    }
    expect_same(triangle, cube);
    found += !reference(triangle, SurfaceKind::thin, cube).empty();
  }
  EXPECT_GT(found, 300);
}

TEST_F(CellsTest, CubesDivideTheSame) {
  for (int i = 0; i < 100; ++i) {
    const SnappedTriangle triangle{{point(32), point(32), point(32)}};
    for (const SurfaceKind kind : {SurfaceKind::thin, SurfaceKind::conservative}) {
      const TriangleCells all(triangle, kind);
      const auto whole = cells(triangle, kind, {{0, 0, 0}, 5});
      std::set<uint64_t> parts;
      for (uint32_t part = 0; part < 512; ++part) {
        const auto p = morton_place(part);
        const Cube cube{
            {static_cast<int32_t>(4 * p.x), static_cast<int32_t>(4 * p.y), static_cast<int32_t>(4 * p.z)}, 2};
        const auto inside = cells(triangle, kind, cube);
        EXPECT_TRUE(inside.empty() || all.touches(cube));
        for (const uint64_t code : inside) parts.insert(part << 6 | code);
      }
      EXPECT_EQ(parts, whole);
    }
  }
}

}  // namespace
}  // namespace voxkit::color
