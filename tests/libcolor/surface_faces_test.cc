// Faces of voxels as rectangles: each face once, of the right colour, in the rectangles that the book has.
#include "libcolor/faces/surface_faces.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <tuple>

#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

using Color = std::array<uint8_t, 3>;
using Cells = std::map<std::array<int32_t, 3>, Color>;
/// A face of one voxel: axis, forwards or not, the place of its lower corner.
using Face = std::tuple<int, bool, std::array<int32_t, 3>>;

Cells cells_of(const Voxels& voxels) {
  Cells cells;
  for (const SurfaceVoxel& voxel : voxels) {
    const auto at = morton_place(voxel.place);
    cells[{static_cast<int32_t>(at.x), static_cast<int32_t>(at.y), static_cast<int32_t>(at.z)}] = {
        voxel.color.r, voxel.color.g, voxel.color.b};
  }
  return cells;
}

/// All faces toward void, voxel by voxel.
std::map<Face, Color> faces_of(const Cells& cells) {
  std::map<Face, Color> faces;
  for (const auto& [at, color] : cells)
    for (int axis = 0; axis < 3; ++axis)
      for (const bool forwards : {false, true}) {
        auto beside = at, corner = at;
        beside[static_cast<size_t>(axis)] += forwards ? 1 : -1;
        corner[static_cast<size_t>(axis)] += forwards;
        if (!cells.contains(beside)) faces[{axis, forwards, corner}] = color;
      }
  return faces;
}

/// What rectangles consist of; each face may be in one only.
std::map<Face, Color> faces_of(const std::vector<FaceRectangle>& rectangles) {
  std::map<Face, Color> faces;
  for (const FaceRectangle& r : rectangles)
    for (int32_t v = r.lo[1]; v < r.hi[1]; ++v)
      for (int32_t u = r.lo[0]; u < r.hi[0]; ++u) {
        std::array<int32_t, 3> at{};
        at[r.axis] = r.plane;
        at[(r.axis + 1u) % 3] = u;
        at[(r.axis + 2u) % 3] = v;
        EXPECT_TRUE(faces.try_emplace({r.axis, r.positive, at}, r.color).second)
            << "a face in two rectangles";
      }
  return faces;
}

/// Greedy meshing by the book, of one side of one layer: at the first face that none has, as wide as the
/// color goes on, then as high as rows have all of it.
size_t rectangles_by_the_book(std::map<std::array<int32_t, 2>, Color> faces) {
  size_t count = 0;
  while (!faces.empty()) {
    // Keys are (v, u), so that the first in order is the first of the lowest row.
    const auto [v, u] = faces.begin()->first;
    const Color color = faces.begin()->second;
    const auto is = [&](int32_t row, int32_t column) {
      const auto at = faces.find({row, column});
      return at != faces.end() && at->second == color;
    };
    int32_t width = 1, height = 1;
    while (is(v, u + width)) ++width;
    const auto full = [&](int32_t row) {
      for (int32_t i = 0; i < width; ++i)
        if (!is(row, u + i)) return false;
      return true;
    };
    while (full(v + height)) ++height;
    for (int32_t row = v; row < v + height; ++row)
      for (int32_t i = 0; i < width; ++i) faces.erase({row, u + i});
    ++count;
  }
  return count;
}

class SurfaceFacesTest : public testing::Test {
 protected:
  SurfaceFacesTest() { ctx_.memory = &memory_; }

  struct Found {
    std::vector<FaceRectangle> faces;
    std::vector<ModelVoxel> enclosed;
    int reads = 0;
  };
  Found find(const Voxels& voxels, const Box& box) {
    Found found;
    const Status status = surface_faces(
        box,
        [&](const Box& part, const SurfaceSource::Sink& sink) -> Status {
          ++found.reads;
          Voxels inside;
          for (const SurfaceVoxel& voxel : voxels)
            if (part.contains(Index3(morton_place(voxel.place)))) inside.push_back(voxel);
          return sink(inside);
        },
        {[&](std::span<const FaceRectangle> faces) -> Status {
           found.faces.insert(found.faces.end(), faces.begin(), faces.end());
           return {};
         },
         [&](std::span<const ModelVoxel> more) -> Status {
           found.enclosed.insert(found.enclosed.end(), more.begin(), more.end());
           return {};
         }},
        ctx_);
    EXPECT_TRUE(status) << status.error().what;
    return found;
  }

  /// Voxels of a cube of 8, so many of 16, of few colors.
  Voxels random_voxels(unsigned of_sixteen, unsigned colors) {
    Voxels voxels;
    for (uint64_t place = 0; place < 512; ++place)
      if (random_() % 16 < of_sixteen)
        voxels.push_back({place, {static_cast<uint8_t>(random_() % colors), 7, 9}});
    return voxels;
  }
  static Box cube(int64_t side) { return {{0, 0, 0}, {side, side, side}}; }

  MemoryBudget memory_;
  Context ctx_;
  std::mt19937 random_{5};
};

TEST_F(SurfaceFacesTest, EachFaceTowardVoidIsInOneRectangleOfItsColor) {
  for (const unsigned share : {1u, 5u, 9u, 13u, 16u})
    for (const unsigned colors : {1u, 2u, 200u}) {
      const Voxels voxels = random_voxels(share, colors);
      const Found found = find(voxels, cube(8));
      EXPECT_EQ(faces_of(found.faces), faces_of(cells_of(voxels))) << share << " " << colors;
    }
}

TEST_F(SurfaceFacesTest, RectanglesAreThoseOfGreedyMeshing) {
  for (int i = 0; i < 20; ++i) {
    const Voxels voxels = random_voxels(6 + static_cast<unsigned>(i) % 8, 1 + static_cast<unsigned>(i) % 3);
    const Found found = find(voxels, cube(8));
    std::map<std::tuple<int, bool, int32_t>, std::map<std::array<int32_t, 2>, Color>> layers;
    for (const auto& [face, color] : faces_of(cells_of(voxels))) {
      const auto& [axis, forwards, at] = face;
      const auto a = static_cast<size_t>(axis);
      layers[{axis, forwards, at[a]}][{at[(a + 2) % 3], at[(a + 1) % 3]}] = color;
    }
    size_t expected = 0;
    for (const auto& [layer, faces] : layers) expected += rectangles_by_the_book(faces);
    EXPECT_EQ(found.faces.size(), expected);
  }
}

TEST_F(SurfaceFacesTest, ABoxIsSixRectangles) {
  Voxels voxels = voxels_where(4, [](uint32_t x, uint32_t y, uint32_t z) {
    return x >= 2 && x < 9 && y >= 1 && y < 4 && z >= 5 && z < 16;
  });
  for (SurfaceVoxel& voxel : voxels) voxel.color = {1, 2, 3};
  const Found found = find(voxels, cube(16));
  ASSERT_EQ(found.faces.size(), 6u);
  for (const FaceRectangle& face : found.faces) {
    const std::array<int32_t, 3> lo{2, 1, 5}, hi{9, 4, 16};
    const size_t w = face.axis, u = (w + 1) % 3, v = (w + 2) % 3;
    EXPECT_EQ(face.plane, face.positive ? hi[w] : lo[w]);
    EXPECT_EQ(face.lo, (std::array<int32_t, 2>{lo[u], lo[v]}));
    EXPECT_EQ(face.hi, (std::array<int32_t, 2>{hi[u], hi[v]}));
  }
  EXPECT_EQ(found.enclosed.size(), 5u * 1 * 9);
}

// What is closed has no border: along each edge of the grid as many sides of rectangles go one way as the
// other.
TEST_F(SurfaceFacesTest, SidesOfRectanglesCancel) {
  for (const unsigned share : {3u, 8u, 14u}) {
    const Found found = find(random_voxels(share, 4), cube(8));
    std::map<std::pair<int, std::array<int32_t, 3>>, int> edges;
    for (const FaceRectangle& face : found.faces) {
      const auto corners = corners_of(face);
      for (size_t i = 0; i < 4; ++i) {
        auto at = corners[i];
        const auto& to = corners[(i + 1) % 4];
        for (int axis = 0; axis < 3; ++axis) {
          const auto a = static_cast<size_t>(axis);
          for (; at[a] < to[a]; ++at[a]) ++edges[{axis, at}];
          for (; at[a] > to[a];) --at[a], --edges[{axis, at}];
        }
      }
    }
    EXPECT_FALSE(edges.empty());
    for (const auto& [edge, sum] : edges) ASSERT_EQ(sum, 0);
  }
}

TEST_F(SurfaceFacesTest, CornersTurnAroundTheOutside) {
  for (uint8_t axis = 0; axis < 3; ++axis)
    for (const bool positive : {false, true}) {
      FaceRectangle face;
      face.axis = axis;
      face.positive = positive;
      face.plane = 4;
      face.lo = {1, 2};
      face.hi = {4, 7};
      const auto c = corners_of(face);
      std::array<int32_t, 3> a, b, normal;
      for (size_t i = 0; i < 3; ++i) a[i] = c[1][i] - c[0][i], b[i] = c[2][i] - c[0][i];
      for (size_t i = 0; i < 3; ++i)
        normal[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
      std::array<int32_t, 3> expected{};
      expected[axis] = positive ? 15 : -15;
      EXPECT_EQ(normal, expected);
    }
}

TEST_F(SurfaceFacesTest, EnclosedVoxelsHaveNeighboursOnAllSides) {
  for (const unsigned share : {10u, 15u, 16u}) {
    const Voxels voxels = random_voxels(share, 3);
    const Cells cells = cells_of(voxels);
    Cells expected;
    for (const auto& [at, color] : cells) {
      bool all = true;
      for (size_t axis = 0; axis < 3; ++axis)
        for (const int step : {-1, 1}) {
          auto beside = at;
          beside[axis] += step;
          all &= cells.contains(beside);
        }
      if (all) expected[at] = color;
    }
    Cells found;
    for (const ModelVoxel& voxel : find(voxels, cube(8)).enclosed) found[voxel.place] = voxel.color;
    EXPECT_EQ(found, expected);
    EXPECT_FALSE(share == 16 && found.size() != 6 * 6 * 6);
  }
}

TEST_F(SurfaceFacesTest, APartIsClosedAtItsSidesAndBeginsAtItsCorner) {
  const Voxels voxels = random_voxels(12, 2);
  const Box part{{1, 2, 3}, {7, 8, 5}};
  Cells inside;
  for (const auto& [at, color] : cells_of(voxels))
    if (part.contains(Index3(at[0], at[1], at[2]))) inside[{at[0] - 1, at[1] - 2, at[2] - 3}] = color;
  EXPECT_EQ(faces_of(find(voxels, part).faces), faces_of(inside));
}

TEST_F(SurfaceFacesTest, LittleMemoryGivesTheSame) {
  const Voxels voxels =
      voxels_where(6, [](uint32_t x, uint32_t y, uint32_t z) { return (x * y + z) % 3 == 0; });
  const Found whole = find(voxels, cube(64));
  EXPECT_EQ(whole.reads, 4);
  MemoryBudget little(600000);  // 87382 voxels of 12 bytes take more than a quarter
  ctx_.memory = &little;
  const Found slabs = find(voxels, cube(64));
  EXPECT_GT(slabs.reads, 10);
  ASSERT_EQ(slabs.faces.size(), whole.faces.size());
  for (size_t i = 0; i < whole.faces.size(); ++i) {
    const FaceRectangle &a = slabs.faces[i], &b = whole.faces[i];
    ASSERT_TRUE(a.axis == b.axis && a.positive == b.positive && a.plane == b.plane && a.lo == b.lo &&
                a.hi == b.hi && a.color == b.color);
  }
  MemoryBudget none(10000);
  ctx_.memory = &none;
  const Status refused = surface_faces(
      cube(64), [&](const Box&, const SurfaceSource::Sink& sink) { return sink(voxels); },
      {[](auto) -> Status { return {}; }, [](auto) -> Status { return {}; }}, ctx_);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::limit);
}

TEST_F(SurfaceFacesTest, NothingHasNoFaces) {
  const Found found = find({}, cube(8));
  EXPECT_TRUE(found.faces.empty());
  EXPECT_TRUE(found.enclosed.empty());
}

}  // namespace
}  // namespace voxkit::color
