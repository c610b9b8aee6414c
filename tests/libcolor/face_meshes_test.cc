// Voxels as meshes, and back: the same voxels, colours and places.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "formats/image/coded_image.h"
#include "formats/mesh/voxel_faces.h"
#include "formats/mesh/voxel_grid.h"
#include "libcolor/faces/surface_faces.h"
#include "libcolor/surface/voxelise.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

class FaceMeshTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!image_codec_support(ImageFormat::png)) GTEST_SKIP() << "no library for PNG";
    folder_ = testing::TempDir() + "voxkit-faces-" + std::to_string(getpid());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directory(folder_);
    ctx_.memory = &memory_;
    ctx_.threads = 2;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  static VolumeInfo info_of(int64_t side, const Affine& affine = {}) {
    VolumeInfo info;
    info.dims = {side, side, side};
    info.format = VoxelFormat::rgba32;
    info.affine = affine;
    return info;
  }

  /// The name of the mesh of these voxels.
  std::string write(const Voxels& voxels, const VolumeInfo& info, const std::string& ending) {
    const std::string name = folder_ + "/mesh" + ending;
    auto writer = create_faces(name, info, true, ctx_);
    EXPECT_TRUE(writer) << writer.error().what;
    if (!writer) return name;
    const Status status = surface_faces(
        info.box(),
        [&](const Box& box, const SurfaceSource::Sink& sink) -> Status {
          Voxels inside;
          for (const SurfaceVoxel& voxel : voxels)
            if (box.contains(Index3(morton_place(voxel.place)))) inside.push_back(voxel);
          return sink(inside);
        },
        {[&](auto faces) { return (*writer)->add(faces); },
         [&](auto enclosed) { return (*writer)->add_enclosed(enclosed); }},
        ctx_);
    EXPECT_TRUE(status) << status.error().what;
    const Status finished = (*writer)->finish();
    EXPECT_TRUE(finished) << finished.error().what;
    return name;
  }

  struct Packed {
    VolumeInfo info;
    Voxels voxels;
    std::vector<std::string> notes;
  };
  Packed voxelise(Mesh mesh, const VoxeliseOptions& options = {}) {
    Packed packed;
    auto surface = make_surface(std::move(mesh), options, ctx_);
    EXPECT_TRUE(surface) << surface.error().what;
    if (!surface) return packed;
    packed.info = (*surface)->info();
    packed.notes = (*surface)->notes();
    const Status status = (*surface)->read(ctx_, [&](std::span<const SurfaceVoxel> run) -> Status {
      packed.voxels.insert(packed.voxels.end(), run.begin(), run.end());
      return {};
    });
    EXPECT_TRUE(status) << status.error().what;
    return packed;
  }
  Mesh read(const std::string& name) {
    auto mesh = read_mesh(name, ctx_);
    EXPECT_TRUE(mesh) << mesh.error().what;
    return mesh ? std::move(*mesh) : Mesh{};
  }

  static void expect_same(const Voxels& a, const Voxels& b) {
    ASSERT_EQ(a.size(), b.size());
    for (size_t i = 0; i < a.size(); ++i)
      ASSERT_TRUE(a[i].place == b[i].place && a[i].color == b[i].color) << i << " of " << a.size();
  }

  static Voxels random_voxels(int height, unsigned of_sixteen, unsigned seed) {
    std::mt19937 random(seed);
    Voxels voxels;
    for (uint64_t place = 0; place < uint64_t{1} << 3 * height; ++place)
      if (random() % 16 < of_sixteen)
        voxels.push_back({place,
                          {static_cast<uint8_t>(random()), static_cast<uint8_t>(random() % 3),
                           static_cast<uint8_t>(random() % 2)}});
    return voxels;
  }

  std::string folder_;
  MemoryBudget memory_;
  Context ctx_;
};

constexpr const char* endings[] = {".glb", ".obj"};

TEST_F(FaceMeshTest, TheSameVoxelsComeBack) {
  for (const char* ending : endings)
    for (const SurfaceKind kind : {SurfaceKind::thin, SurfaceKind::conservative})
      for (const unsigned share : {1u, 6u, 12u, 16u}) {
        const Voxels voxels = random_voxels(4, share, share);
        const Packed packed = voxelise(read(write(voxels, info_of(16), ending)), {.kind = kind});
        EXPECT_EQ(packed.info.dims, Index3(16));
        expect_same(packed.voxels, voxels);
      }
}

TEST_F(FaceMeshTest, SoDoThoseOfScenes) {
  for (const char* ending : endings) {
    const Voxels shell = sphere_shell(6);
    expect_same(voxelise(read(write(shell, info_of(64), ending))).voxels, shell);
    const Voxels walls =
        voxels_where(5, [](uint32_t x, uint32_t y, uint32_t z) { return x == 7 || y * 2 == z; });
    expect_same(voxelise(read(write(walls, info_of(32), ending)), {.resolution = 32}).voxels, walls);
    const Voxels one = {{morton_code(3, 1, 2), {250, 128, 1}}};
    expect_same(voxelise(read(write(one, info_of(5), ending))).voxels, one);
  }
}

TEST_F(FaceMeshTest, SoDoPlaces) {
  Affine odd = Affine::plain({0.1, 0.037, 1.0 / 3}, {-5.7, 1e-3, 12.3456789});
  Affine far = Affine::plain({0.001, 0.001, 0.001}, {500000, 4000000, -70});
  Affine turned;
  turned.axes = {{{0.6, 0.8, 0}, {-0.8, 0.6, 0}, {0, 0, 2}}};
  Affine mirrored = odd;
  mirrored.axes[1][1] = -mirrored.axes[1][1];
  Affine swapped;
  swapped.axes = {{{0, 0, 2}, {0, 2, 0}, {2, 0, 0}}};
  Affine sheared;
  sheared.axes = {{{1, 0, 0}, {0.5, 1, 0}, {0.1, -0.2, 0.7}}};
  sheared.origin = {3, 4, 5};
  Affine sheared_mirror = sheared;
  sheared_mirror.axes[0][0] = -1;
  const Voxels voxels = random_voxels(4, 5, 99);
  for (const char* ending : endings)
    for (const Affine& affine : {odd, far, turned, mirrored, swapped, sheared, sheared_mirror}) {
      VolumeInfo info = info_of(16, affine);
      info.world = World::lps;
      info.unit = Unit::millimetre;
      info.description = "a \"line\"";
      Mesh mesh = read(write(voxels, info, ending));
      // Looked at from outside corners turn counterclockwise: then the volume that they enclose is above 0.
      double volume = 0;
      for (const MeshTriangle& triangle : mesh.triangles) {
        std::array<glm::dvec3, 3> p;
        for (size_t i = 0; i < 3; ++i)
          p[i] = mesh.positions[triangle.vertices[i]] -
                 glm::dvec3(affine.origin[0], affine.origin[1], affine.origin[2]);
        volume +=
            (p[0].x * (p[1].y * p[2].z - p[1].z * p[2].y) + p[0].y * (p[1].z * p[2].x - p[1].x * p[2].z) +
             p[0].z * (p[1].x * p[2].y - p[1].y * p[2].x)) /
            6;
      }
      const double expected = std::abs(affine.determinant()) * static_cast<double>(voxels.size());
      EXPECT_NEAR(volume, expected, 1e-4 * expected);
      const Packed packed = voxelise(std::move(mesh));
      expect_same(packed.voxels, voxels);
      EXPECT_EQ(packed.info.affine, affine);
      EXPECT_EQ(packed.info.world, World::lps);
      EXPECT_EQ(packed.info.unit, Unit::millimetre);
      EXPECT_EQ(packed.info.description, "a \"line\"");
    }
}

// The grid is that of the file where it is asked for, or nothing is.
TEST_F(FaceMeshTest, AnotherResolutionIsAnotherGrid) {
  const Voxels voxels = {{morton_code(2, 2, 2), {9, 9, 9}}};
  const std::string name = write(voxels, info_of(8), ".glb");
  EXPECT_EQ(voxelise(read(name)).info.dims, Index3(8));
  EXPECT_EQ(voxelise(read(name), {.resolution = 8}).info.dims, Index3(8));
  const Packed finer = voxelise(read(name), {.resolution = 4});
  EXPECT_EQ(finer.info.dims, Index3(4));
  EXPECT_EQ(finer.voxels.size(), 64u - 8);
}

TEST_F(FaceMeshTest, AGridThatIsNotAroundTheMeshIsNotTaken) {
  Mesh mesh = read(write({{morton_code(2, 2, 2), {9, 9, 9}}}, info_of(8), ".obj"));
  mesh.positions[0].x += 100;
  const Packed packed = voxelise(std::move(mesh), {.resolution = 4});
  EXPECT_EQ(packed.info.dims.x, 4);
  ASSERT_EQ(packed.notes.size(), 1u);
  EXPECT_EQ(packed.notes[0], "its grid of 8 x 8 x 8 voxels is not around all of it: dropped");
}

// Corners that are near the borders of voxels, as programs leave them that calculate in floats.
TEST_F(FaceMeshTest, WhatIsALittleOffIsInTheSameVoxels) {
  const Voxels voxels = random_voxels(4, 6, 3);
  Mesh mesh = read(write(voxels, info_of(16), ".glb"));
  std::mt19937 random(1);
  std::uniform_real_distribution<double> off(-0.01, 0.01);
  for (glm::dvec3& p : mesh.positions) p += glm::dvec3(off(random), off(random), off(random));
  expect_same(voxelise(std::move(mesh)).voxels, voxels);
}

// Triangles that are no faces of voxels are taken as they are.
TEST_F(FaceMeshTest, OtherTrianglesInTheGridAreAsEver) {
  Mesh plain;
  plain.positions = {{0, 0, 0}, {8, 0, 0}, {8, 8, 8}, {0, 8, 8}};
  plain.triangles = {{{0, 1, 2}, 0}, {{0, 2, 3}, 0}};
  plain.materials.resize(1);
  Mesh with_grid;
  with_grid.positions = plain.positions;
  with_grid.triangles = plain.triangles;
  with_grid.materials.resize(1);
  with_grid.grid = info_of(8, Affine::plain({1, 1, 1}, {0.5, 0.5, 0.5}));
  expect_same(voxelise(std::move(with_grid)).voxels, voxelise(std::move(plain), {.resolution = 8}).voxels);
}

}  // namespace
}  // namespace voxkit::color
