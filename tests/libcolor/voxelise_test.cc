// Meshes to voxels: the right ones, in order, the same for all ways to divide the work.
#include "libcolor/surface/voxelise.h"

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>
#include <queue>

#include "tests/libcolor/meshes.h"
#include "tests/libcolor/voxelise_reference.h"

namespace voxkit::color {
namespace {

class VoxeliseTest : public MeshTest {
 protected:
  glm::dvec3 random_point() {
    std::uniform_real_distribution<double> any(-3, 5);
    return {any(random_), any(random_), any(random_)};
  }
  Mesh random_mesh(int triangles) {
    Mesh mesh;
    mesh.materials = {plain(1, 0.2f, 0), plain(0, 0.7f, 0.3f), plain(0.5f, 0.5f, 1)};
    for (int i = 0; i < triangles; ++i) {
      const glm::dvec3 first = random_point();
      const double size = i % 3 == 0 ? 1 : i % 3 == 1 ? 0.1 : 0.01;
      add_triangle(mesh, {{first, first + size * random_point(), first + size * random_point()}},
                   static_cast<uint32_t>(i) % 3);
    }
    return mesh;
  }

  /// Corners where the header says that they go: the middle of the 256th of a voxel that they are in.
  static std::vector<SnappedTriangle> snapped(const Mesh& mesh, int64_t resolution) {
    glm::dvec3 lo(1e300), hi(-1e300);
    for (const glm::dvec3& p : mesh.positions) lo = glm::min(lo, p), hi = glm::max(hi, p);
    const glm::dvec3 size = hi - lo;
    const double scale = static_cast<double>(resolution * 256) / std::max({size.x, size.y, size.z});
    std::vector<SnappedTriangle> out;
    for (const MeshTriangle& triangle : mesh.triangles) {
      SnappedTriangle s;
      for (size_t i = 0; i < 3; ++i)
        for (int c = 0; c < 3; ++c) {
          // The end of the grid belongs to the last voxel.
          const double voxels = std::max(1.0, std::ceil(std::round(size[c] * scale) / 256));
          const double step = std::floor((mesh.positions[triangle.vertices[i]][c] - lo[c]) * scale);
          s.corners[i][static_cast<size_t>(c)] =
              static_cast<int32_t>(2 * std::min(step, voxels * 256 - 1) + 1);
        }
      out.push_back(s);
    }
    return out;
  }

  static std::vector<uint64_t> reference(const Mesh& mesh, int64_t resolution, SurfaceKind kind) {
    std::vector<uint64_t> places;
    for (const SnappedTriangle& triangle : snapped(mesh, resolution)) {
      const ReferenceCells cells(triangle);
      std::array<int32_t, 3> lo, hi;
      for (size_t c = 0; c < 3; ++c) {
        lo[c] = std::min({triangle.corners[0][c], triangle.corners[1][c], triangle.corners[2][c]}) / 512;
        hi[c] = std::max({triangle.corners[0][c], triangle.corners[1][c], triangle.corners[2][c]}) / 512;
      }
      for (int32_t z = lo[2]; z <= hi[2]; ++z)
        for (int32_t y = lo[1]; y <= hi[1]; ++y)
          for (int32_t x = lo[0]; x <= hi[0]; ++x)
            if (cells.in(kind, x, y, z))
              places.push_back(
                  morton_code(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z)));
    }
    std::sort(places.begin(), places.end());
    places.erase(std::unique(places.begin(), places.end()), places.end());
    return places;
  }

  /// Whether a walk from face to face, which passes by the voxels, comes from outside of the grid to
  /// `inside`.
  bool leaks(const std::vector<SurfaceVoxel>& voxels, glm::ivec3 inside) const {
    const glm::ivec3 dims = glm::ivec3(info_.dims) + 2;
    std::vector<char> solid(static_cast<size_t>(dims.x) * dims.y * dims.z);
    const auto at = [&](glm::ivec3 p) -> char& {
      return solid[static_cast<size_t>(p.x) +
                   static_cast<size_t>(dims.x) * (p.y + static_cast<size_t>(dims.y) * p.z)];
    };
    for (const SurfaceVoxel& voxel : voxels) at(glm::ivec3(morton_place(voxel.place)) + 1) = 1;
    inside += 1;
    EXPECT_EQ(at(inside), 0) << "the place to reach is not empty";
    std::queue<glm::ivec3> next;
    next.push({0, 0, 0});
    at({0, 0, 0}) = 1;
    while (!next.empty()) {
      const glm::ivec3 p = next.front();
      next.pop();
      if (p == inside) return true;
      for (int c = 0; c < 3; ++c)
        for (const int step : {-1, 1}) {
          glm::ivec3 q = p;
          q[c] += step;
          if (q[c] < 0 || q[c] >= dims[c] || at(q)) continue;
          at(q) = 1;
          next.push(q);
        }
    }
    return false;
  }

  /// A ball around (0, 0, 0), pulled along y.
  Mesh ball(int slices, double stretch) {
    Mesh mesh;
    mesh.materials = {plain(1, 1, 1)};
    const auto at = [&](int i, int j) {
      const double a = i * 2 * std::numbers::pi / slices, b = (j * std::numbers::pi) / slices;
      return glm::dvec3(std::sin(b) * std::cos(a), stretch * std::cos(b), std::sin(b) * std::sin(a));
    };
    for (int j = 0; j < slices; ++j)
      for (int i = 0; i < slices; ++i) {
        const int next = (i + 1) % slices;  // the same numbers at the seam
        add_triangle(mesh, {{at(i, j), at(next, j), at(i, j + 1)}});
        add_triangle(mesh, {{at(next, j), at(next, j + 1), at(i, j + 1)}});
      }
    return mesh;
  }
};

TEST_F(VoxeliseTest, EveryVoxelAndNoOther) {
  std::vector<std::pair<int64_t, int>> sizes{{1, 40}, {2, 40}, {7, 40}, {16, 40}, {64, 40}, {128, 40}};
  // VOXKIT_BRUTE_FORCE=1024@2, say, asks of each voxel around two triangles: minutes.
  if (const char* more = std::getenv("VOXKIT_BRUTE_FORCE")) {
    sizes = {{}};
    ASSERT_EQ(std::sscanf(more, "%" SCNd64 "@%d", &sizes[0].first, &sizes[0].second), 2);
  }
  for (const auto& [resolution, triangles] : sizes)
    for (const SurfaceKind kind : {SurfaceKind::thin, SurfaceKind::conservative}) {
      const auto seed = static_cast<unsigned>(random_());
      random_.seed(seed);
      const auto want = reference(random_mesh(triangles), resolution, kind);
      random_.seed(seed);
      std::vector<uint64_t> have;
      for (const SurfaceVoxel& voxel : voxelise(random_mesh(triangles), {resolution, kind}))
        have.push_back(voxel.place);
      EXPECT_EQ(have, want) << resolution;
    }
}

TEST_F(VoxeliseTest, TheGridFitsTheMesh) {
  Mesh mesh;
  mesh.materials = {plain(1, 1, 1)};
  add_triangle(mesh, {{{-1, 10, 0}, {3, 10, 0}, {-1, 10.85, 0.5}}});
  const auto voxels = voxelise(std::move(mesh), {8, SurfaceKind::conservative});
  EXPECT_EQ(info_.dims, Index3(8, 2, 1));
  EXPECT_EQ(info_.format, VoxelFormat::rgba32);
  for (const double spacing : info_.affine.spacing()) EXPECT_EQ(spacing, 0.5);
  EXPECT_EQ(info_.affine.origin, (std::array<double, 3>{-0.75, 10.25, 0.25}));
  // Its slope is at height 1 after 3.3 voxels: 4 of them above 8.
  EXPECT_EQ(voxels.size(), 12u);
}

TEST_F(VoxeliseTest, WaysToDivideTheWork) {
  std::vector<SurfaceVoxel> first;
  for (const int threads : {1, 2, 7})
    for (const int tile_bits : {0, 1, 3, 6, 8}) {
      random_.seed(3);
      Mesh mesh = random_mesh(200);
      mesh.pictures.push_back(picture(32, 32, [&](int64_t, int64_t) {
        return std::array<uint8_t, 4>{static_cast<uint8_t>(random_()), static_cast<uint8_t>(random_()), 7,
                                      static_cast<uint8_t>(random_())};
      }));
      for (glm::vec2& uv : mesh.uvs)
        uv = {static_cast<float>(random_() % 100) / 30, static_cast<float>(random_() % 100) / 30};
      mesh.materials[0].picture = mesh.materials[1].picture = 0;
      mesh.materials[1].alpha_mode = AlphaMode::blend;
      // The order of the triangles does not matter, either.
      if (threads == 2) std::reverse(mesh.triangles.begin(), mesh.triangles.end());
      ctx_.threads = threads;
      const auto voxels = voxelise(std::move(mesh), {150, SurfaceKind::thin, tile_bits});
      if (first.empty()) first = voxels;
      ASSERT_GT(voxels.size(), 5000u);
      EXPECT_TRUE(voxels == first) << threads << " threads, tiles of 2^" << tile_bits;
    }
}

TEST_F(VoxeliseTest, ManyTrianglesInFewVoxels) {
  // More than a cube is worked on with at once: it is split, down to single voxels.
  const auto make = [&] {
    random_.seed(9);
    Mesh mesh;
    mesh.materials = {plain(1, 0, 0), plain(0, 0, 1)};
    for (uint32_t i = 0; i < 40000; ++i)
      add_triangle(mesh, {{random_point(), random_point(), random_point()}}, i % 2);
    return mesh;
  };
  const auto whole = voxelise(make(), {3, SurfaceKind::conservative});
  EXPECT_EQ(whole.size(), 27u);
  for (const SurfaceVoxel& voxel : whole) EXPECT_NEAR(voxel.color.r, 188, 3);  // half of the light
  EXPECT_TRUE(whole == voxelise(make(), {3, SurfaceKind::conservative, 0}));
}

TEST_F(VoxeliseTest, ClosedSurfacesAreTight) {
  for (const int64_t resolution : {9, 32, 77, 128}) {
    for (const int slices : {5, 16, 90}) {
      const auto voxels = voxelise(ball(slices, 0.7), {resolution});
      EXPECT_FALSE(leaks(voxels, glm::ivec3(info_.dims) / 2)) << resolution << " " << slices;
    }
    for (int i = 0; i < 10; ++i) {
      // A tetrahedron, at any angle, with room around its centre.
      Mesh mesh;
      mesh.materials = {plain(1, 1, 1)};
      std::array<glm::dvec3, 4> corners;
      double volume = 0;
      while (volume < 60) {
        for (glm::dvec3& corner : corners) corner = random_point();
        volume = std::abs(
            glm::dot(corners[1] - corners[0], glm::cross(corners[2] - corners[0], corners[3] - corners[0])));
      }
      glm::dvec3 lo(1e9), middle(0);
      for (const glm::dvec3& corner : corners) lo = glm::min(lo, corner), middle += corner / 4.0;
      for (size_t i0 = 0; i0 < 4; ++i0)
        add_triangle(mesh, {{corners[i0], corners[(i0 + 1) % 4], corners[(i0 + 2) % 4]}});
      const auto voxels = voxelise(std::move(mesh), {resolution});
      EXPECT_FALSE(resolution >= 32 && leaks(voxels, glm::ivec3((middle - lo) / info_.affine.spacing()[0])))
          << resolution;
    }
  }
}

TEST_F(VoxeliseTest, ThinIsThin) {
  // A square at any angle: a voxel or so for each of those that its largest projection has.
  Mesh mesh;
  mesh.materials = {plain(1, 1, 1)};
  const glm::dvec3 a(0, 0, 0), b(10, 2, 3), c(-2, 10, 1);
  add_triangle(mesh, {{a, b, c}});
  add_triangle(mesh, {{b + c, c, b}});
  const double area = 10 * 10 + 2 * 2;  // of the projection along z
  const auto voxels = voxelise(std::move(mesh), {1000});
  const double voxel = info_.affine.spacing()[0] * info_.affine.spacing()[1];
  EXPECT_NEAR(static_cast<double>(voxels.size()) * voxel / area, 1, 0.01);
}

TEST_F(VoxeliseTest, LargestResolution) {
  // A square at an angle of 1 in 2^21 is too much to walk through; a sliver along an edge is not.
  Mesh mesh;
  mesh.materials = {plain(1, 1, 1)};
  add_triangle(mesh, {{{0, 0, 0}, {2097152, 1, 0}, {2097152, 0.5, 0}}});
  const auto voxels = voxelise(std::move(mesh), {int64_t{1} << 21});
  EXPECT_EQ(info_.dims, Index3(1 << 21, 1, 1));
  EXPECT_GT(voxels.size(), size_t{1} << 20);  // where it passes near the centres
  EXPECT_LE(voxels.size(), size_t{1} << 21);
}

TEST_F(VoxeliseTest, Refusals) {
  for (const int64_t resolution : {int64_t{0}, int64_t{-5}, (int64_t{1} << 21) + 1}) {
    const auto surface = make_surface(random_mesh(3), {resolution}, ctx_);
    ASSERT_FALSE(surface);
    EXPECT_EQ(surface.error().code, ErrorCode::usage);
  }
  const auto none = make_surface(Mesh{}, {}, ctx_);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::input);

  MemoryBudget small(100 << 10);
  ctx_.memory = &small;
  auto surface = make_surface(random_mesh(30), {64}, ctx_);
  ASSERT_TRUE(surface);
  const Status status = (*surface)->read(ctx_, [](auto) -> Status { return {}; });
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::limit);
  EXPECT_NE(status.error().what.find("--max-memory"), std::string::npos);
}

TEST_F(VoxeliseTest, ErrorsOfTheSinkEndIt) {
  auto surface = make_surface(random_mesh(30), {64}, ctx_);
  ASSERT_TRUE(surface);
  int calls = 0;
  const Status status = (*surface)->read(ctx_, [&](auto) -> Status {
    ++calls;
    return fail(ErrorCode::output, "x", "full");
  });
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().what, "full");
  EXPECT_EQ(calls, 1);
}

}  // namespace
}  // namespace voxkit::color
