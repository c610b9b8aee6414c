// Colours of voxels against what is known of a mesh.
#include <cmath>

#include "libcolor/surface/linear_light.h"
#include "tests/libcolor/meshes.h"

namespace voxkit::color {
namespace {

double linear(double stored) {
  stored /= 255;
  return stored <= 0.04045 ? stored / 12.92 : std::pow((stored + 0.055) / 1.055, 2.4);
}
double stored(double light) {
  return 255 * (light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055);
}

class VoxeliseColorTest : public MeshTest {
 protected:
  static void expect_near(Rgb have, double r, double g, double b, double tolerance = 1) {
    EXPECT_NEAR(have.r, r, tolerance);
    EXPECT_NEAR(have.g, g, tolerance);
    EXPECT_NEAR(have.b, b, tolerance);
  }
  /// A square of `resolution` voxels a side with a picture, and its colours at (x, y).
  std::map<uint64_t, Rgb> draw(Picture picture, int64_t resolution, float uv, const MeshMaterial& material) {
    Mesh mesh;
    add_square(mesh, 1, 0, 0, uv);
    mesh.materials = {material};
    mesh.materials[0].picture = 0;
    mesh.pictures.push_back(std::move(picture));
    return by_place(voxelise(std::move(mesh), {resolution}));
  }
  static uint64_t at(uint32_t x, uint32_t y) { return morton_code(x, y, 0); }
};

TEST_F(VoxeliseColorTest, TablesOfLight) {
  const LightTables& tables = light_tables();
  for (size_t i = 0; i < 256; ++i) {
    EXPECT_NEAR(tables.linear[i], linear(static_cast<double>(i)) * 65535, 0.501);
    EXPECT_EQ(tables.stored[tables.linear[i]], i);
  }
  for (size_t i = 0; i < 65536; ++i)
    EXPECT_NEAR(tables.stored[i], stored(static_cast<double>(i) / 65535), 0.501);
}

TEST_F(VoxeliseColorTest, PlainColorsAreExact) {
  for (int value = 0; value < 256; ++value) {
    const auto light = static_cast<float>(linear(value));
    Mesh mesh;
    mesh.materials = {plain(light, 0, 1)};
    add_square(mesh, 1);
    for (const SurfaceVoxel& voxel : voxelise(std::move(mesh), {3}))
      EXPECT_EQ(voxel.color, (Rgb{static_cast<uint8_t>(value), 0, 255}));
  }
}

TEST_F(VoxeliseColorTest, TexelsOfTheVoxelsSize) {
  // The first row of a picture is at the top, where y is large and v is 0.
  const auto color = [](int64_t x, int64_t y) {
    return std::array<uint8_t, 4>{static_cast<uint8_t>(100 + x * 8), static_cast<uint8_t>(100 + y * 8), 100,
                                  255};
  };
  const auto voxels = draw(picture(16, 16, color), 16, 1, {});
  ASSERT_EQ(voxels.size(), 256u);
  for (uint32_t y = 0; y < 16; ++y)
    for (uint32_t x = 0; x < 16; ++x)
      expect_near(voxels.at(at(x, y)), 100 + x * 8, 100 + (15 - y) * 8, 100, 2);
}

TEST_F(VoxeliseColorTest, MeansAreOfLight) {
  // Black and white texels, 16 x 16 of them a voxel: half of the light.
  const auto checker = [](int64_t x, int64_t y) {
    const auto value = static_cast<uint8_t>((x ^ y) & 1 ? 255 : 0);
    return std::array<uint8_t, 4>{value, value, 0, 255};
  };
  for (const auto& [place, color] : draw(picture(256, 256, checker), 16, 1, {}))
    expect_near(color, stored(0.5), stored(0.5), 0);
  // A side that is no power of two, in 10 x 10 voxels.
  for (const auto& [place, color] : draw(picture(330, 330, checker), 10, 1, {}))
    expect_near(color, stored(0.5), stored(0.5), 0);
}

TEST_F(VoxeliseColorTest, FootprintsBetweenLevels) {
  // A ramp in linear light looks the same at any size.
  const auto ramp = [](int64_t x, int64_t) {
    const auto value = static_cast<uint8_t>(std::lround(stored((static_cast<double>(x) + 0.5) / 512)));
    return std::array<uint8_t, 4>{value, value, value, 255};
  };
  for (const int64_t resolution : {20, 33, 100, 300, 700})
    for (const auto& [place, color] : draw(picture(512, 4, ramp), resolution, 1, {})) {
      const double x = (morton_place(place).x + 0.5) / static_cast<double>(resolution);
      if (x < 0.15 || x > 0.85) continue;  // the picture goes on at the other side
      EXPECT_NEAR(linear(color.r), x, 0.012) << resolution;
    }
}

TEST_F(VoxeliseColorTest, BeyondThePicture) {
  const auto halves = [](int64_t x, int64_t y) {
    return std::array<uint8_t, 4>{static_cast<uint8_t>(x < 8 ? 255 : 0),
                                  static_cast<uint8_t>(y < 8 ? 255 : 0), 0, 255};
  };
  // Three pictures a side, of 8 voxels each: what is at the quarters of each half.
  const auto check = [&](PictureWrap wrap, const std::array<bool, 6>& lit) {
    MeshMaterial material;
    material.wrap_u = material.wrap_v = wrap;
    const auto voxels = draw(picture(16, 16, halves), 24, 3, material);
    for (uint32_t half = 0; half < 6; ++half) {
      const double want = lit[half] ? 255 : 0;
      expect_near(voxels.at(at(half * 4 + 1, 22)), want, voxels.at(at(1, 22)).g, 0, 2);
      // v counts from the top.
      EXPECT_NEAR(voxels.at(at(1, 23 - (half * 4 + 1))).g, want, 2) << half;
    }
  };
  check(PictureWrap::repeat, {true, false, true, false, true, false});
  check(PictureWrap::mirror, {true, false, false, true, true, false});
  check(PictureWrap::clamp, {true, false, false, false, false, false});
}

TEST_F(VoxeliseColorTest, MaterialsAndCornersMultiply) {
  Mesh mesh;
  mesh.pictures.push_back(picture(1, 1, [](int64_t, int64_t) {
    return std::array<uint8_t, 4>{200, 100, 50, 255};
  }));
  mesh.materials = {plain(0.5f, 1, 0.25f)};
  mesh.materials[0].picture = 0;
  add_square(mesh, 1);
  for (const glm::dvec3& p : mesh.positions) mesh.colors.push_back({static_cast<float>(p.x), 1, 0.5f, 1});
  const auto voxels = by_place(voxelise(std::move(mesh), {10}));
  for (uint32_t x = 0; x < 10; ++x)
    expect_near(voxels.at(at(x, 3)), stored(linear(200) * 0.5 * (x + 0.5) / 10), 100,
                stored(linear(50) * 0.125));
}

TEST_F(VoxeliseColorTest, WeightedByArea) {
  // Strips of a third and two thirds of a voxel, and one of 1 % that does not reach the centre.
  Mesh mesh;
  mesh.materials = {plain(1, 0, 0), plain(0, 1, 0), plain(1, 1, 1)};
  const auto strip = [&](double x0, double x1, uint32_t material) {
    add_triangle(mesh, {{{x0, 0, 0}, {x1, 0, 0}, {x0, 3, 0}}}, material);
    add_triangle(mesh, {{{x1, 3, 0}, {x0, 3, 0}, {x1, 0, 0}}}, material);
  };
  strip(0, 1.0 / 3, 0);
  strip(1.0 / 3, 1, 1);
  strip(1, 3, 2);
  const auto voxels = by_place(voxelise(std::move(mesh), {3, SurfaceKind::thin}));
  for (uint32_t y = 0; y < 3; ++y) {
    expect_near(voxels.at(at(0, y)), stored(1.0 / 3), stored(2.0 / 3), 0, 2);
    EXPECT_EQ(voxels.at(at(2, y)), (Rgb{255, 255, 255}));
  }
}

TEST_F(VoxeliseColorTest, AreaAtAnAngle) {
  // A voxel with a face and a slope in it: 1 and the square root of 2.
  Mesh mesh;
  mesh.materials = {plain(1, 0, 0), plain(0, 0, 1)};
  add_triangle(mesh, {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}, 0);
  add_triangle(mesh, {{{1, 1, 0}, {0, 1, 0}, {1, 0, 0}}}, 0);
  add_triangle(mesh, {{{0, 0, 0}, {1, 0, 1}, {0, 1, 0}}}, 1);
  add_triangle(mesh, {{{1, 1, 1}, {0, 1, 0}, {1, 0, 1}}}, 1);
  const auto voxels = voxelise(std::move(mesh), {1, SurfaceKind::conservative});
  ASSERT_EQ(voxels.size(), 1u);
  const double root = std::sqrt(2.0);
  expect_near(voxels[0].color, stored(1 / (1 + root)), 0, stored(root / (1 + root)));
}

TEST_F(VoxeliseColorTest, CutOff) {
  const auto leaf = [](int64_t x, int64_t) {
    return std::array<uint8_t, 4>{static_cast<uint8_t>(x < 8 ? 90 : 255), 180, 40,
                                  static_cast<uint8_t>(x < 8 ? 255 : 20)};
  };
  MeshMaterial material;
  for (const auto& [mode, cutoff, factor, columns] :
       {std::tuple(AlphaMode::opaque, 0.5f, 1.0f, 16u),
        {AlphaMode::mask, 0.5f, 1.0f, 8u},
        {AlphaMode::mask, 0.05f, 1.0f, 16u},
        {AlphaMode::mask, 0.5f, 0.4f, 0u},
        {AlphaMode::blend, 0.5f, 1.0f, 8u},
        {AlphaMode::blend, 0.5f, 0.9f, 8u},
        {AlphaMode::blend, 0.5f, 0.5f, 6u},  // its borders are mixed with what is clear
        {AlphaMode::blend, 0.5f, 0.49f, 0u},
        {AlphaMode::blend, 0.5f, 0.02f, 0u},
        {AlphaMode::blend, 0.5f, 0.0f, 0u}}) {
    SCOPED_TRACE(testing::Message() << static_cast<int>(mode) << " " << cutoff << " " << factor);
    material.alpha_mode = mode;
    material.alpha_cutoff = cutoff;
    material.color.a = factor;
    const auto voxels = draw(picture(16, 16, leaf), 16, 1, material);
    EXPECT_EQ(voxels.size(), columns * 16);
    for (const auto& [place, color] : voxels) {
      const uint32_t x = morton_place(place).x;
      EXPECT_NEAR(color.g, 180, 1);
      // What is not there gives no colour: not even next to the border.
      EXPECT_NEAR(color.r, x < 8 ? 90 : 255, columns < 16u ? 2 : 255) << x;
    }
  }
}

TEST_F(VoxeliseColorTest, BlendedCountByTheirAlpha) {
  Mesh mesh;
  mesh.materials = {plain(1, 0, 0), plain(0, 1, 0, 0.25f)};
  mesh.materials[1].alpha_mode = AlphaMode::blend;
  add_square(mesh, 1, 0);
  add_square(mesh, 1, 1);
  for (const SurfaceVoxel& voxel : voxelise(std::move(mesh), {4}))
    expect_near(voxel.color, stored(0.8), stored(0.2), 0);
}

TEST_F(VoxeliseColorTest, WhatIsBlendedIsThereFromAHalfOn) {
  const auto with = [&](AlphaMode mode, float alpha) {
    Mesh mesh;
    mesh.materials = {plain(1, 0, 0, alpha), plain(0, 1, 0)};
    mesh.materials[0].alpha_mode = mode;
    add_square(mesh, 1, 0);
    add_square(mesh, 1, 1, 3);  // opaque, elsewhere
    auto surface = make_surface(std::move(mesh), {.resolution = 4, .attributes = AttributeSet()}, ctx_);
    EXPECT_TRUE(surface);
    const bool noted = !(*surface)->notes().empty();
    size_t red = 0;
    EXPECT_TRUE((*surface)->read(ctx_, [&](std::span<const SurfaceVoxel> run) -> Status {
      for (const SurfaceVoxel& voxel : run) red += voxel.color.r == 255;
      return {};
    }));
    return std::pair(red > 0, noted);
  };
  EXPECT_EQ(with(AlphaMode::blend, 0.02f), std::pair(false, true));
  EXPECT_EQ(with(AlphaMode::blend, 0.49f), std::pair(false, true));
  EXPECT_EQ(with(AlphaMode::blend, 0.5f), std::pair(true, true));
  EXPECT_EQ(with(AlphaMode::blend, 0.9f), std::pair(true, true));
  EXPECT_EQ(with(AlphaMode::blend, 1), std::pair(true, false));
  EXPECT_EQ(with(AlphaMode::opaque, 0.02f), std::pair(true, false));
}

TEST_F(VoxeliseColorTest, EmissionIsAdded) {
  const auto lamp = [&](bool add, bool pictured) {
    Mesh mesh;
    mesh.materials = {plain(0.25f, 0, 0)};
    mesh.materials[0].emission = {0.25f, 0.5f, 4};
    add_square(mesh, 1);
    if (pictured) {
      // Its own coordinates: what is black in the lower half there is to the left.
      mesh.pictures.push_back(picture(16, 16, [](int64_t x, int64_t) {
        const auto value = static_cast<uint8_t>(x < 8 ? 0 : 255);
        return std::array<uint8_t, 4>{value, value, value, 255};
      }));
      mesh.materials[0].emission_picture = 0;
      for (const glm::dvec3& p : mesh.positions) mesh.emission_uvs.push_back(glm::vec2(p.y, p.x));
    }
    auto surface = make_surface(std::move(mesh), {.resolution = 16, .emission = add}, ctx_);
    EXPECT_TRUE(surface);
    EXPECT_EQ((*surface)->emits(), add);
    EXPECT_EQ((*surface)->notes().size(), add ? 0u : 1u);
    std::map<uint64_t, Rgb> voxels;
    EXPECT_TRUE((*surface)->read(ctx_, [&](std::span<const SurfaceVoxel> run) -> Status {
      for (const SurfaceVoxel& voxel : run) voxels[voxel.place] = voxel.color;
      return {};
    }));
    return voxels;
  };
  for (const auto& [place, color] : lamp(true, false)) expect_near(color, stored(0.5), stored(0.5), 255);
  for (const auto& [place, color] : lamp(false, false)) expect_near(color, stored(0.25), 0, 0);
  const auto half = lamp(true, true);
  for (uint32_t x = 0; x < 16; ++x) {
    expect_near(half.at(at(x, 13)), stored(0.5), stored(0.5), 255);
    expect_near(half.at(at(x, 2)), stored(0.25), 0, 0);
  }
}

TEST_F(VoxeliseColorTest, NearestTexelsAreAsTheyAre) {
  const auto chess = [](int64_t x, int64_t y) {
    const auto value = static_cast<uint8_t>((x ^ y) & 1 ? 255 : 0);
    return std::array<uint8_t, 4>{value, value, value, 255};
  };
  MeshMaterial material;
  material.filter = PictureFilter::nearest;
  for (const PictureWrap wrap : {PictureWrap::repeat, PictureWrap::clamp, PictureWrap::mirror}) {
    material.wrap_u = material.wrap_v = wrap;
    for (const auto& [place, color] : draw(picture(4, 4, chess), 32, 1, material)) {
      const auto p = morton_place(place);
      const int want = ((p.x / 8) ^ ((31 - p.y) / 8)) & 1 ? 255 : 0;
      EXPECT_EQ(color.r, want) << p.x << " " << p.y;
    }
  }
  // Smaller than voxels they are averaged all the same.
  for (const auto& [place, color] : draw(picture(64, 64, chess), 8, 1, material))
    expect_near(color, stored(0.5), stored(0.5), stored(0.5));
}

TEST_F(VoxeliseColorTest, PointsOfMeshes) {
  const auto mesh_of = [&](bool square, size_t points) {
    Mesh mesh;
    mesh.materials = {plain(1, 0, 0), plain(0, 1, 0)};
    if (square) add_square(mesh, 1);
    for (uint32_t i = 0; i < points; ++i) {
      mesh.points.push_back({static_cast<uint32_t>(mesh.positions.size()), i});
      mesh.positions.push_back(i ? glm::dvec3(0.51, 0.51, 0.99) : glm::dvec3(0.5, 0.5, 1));
    }
    mesh.uvs.resize(mesh.positions.size());
    return mesh;
  };
  const auto voxels = by_place(voxelise(mesh_of(true, 2), {8}));
  EXPECT_EQ(voxels.size(), 65u);
  expect_near(voxels.at(morton_code(4, 4, 7)), stored(0.5), stored(0.5), 0);
  // Points alone; a single one.
  EXPECT_EQ(voxelise(mesh_of(false, 2), {8}).size(), 2u);
  EXPECT_EQ(voxelise(mesh_of(false, 1), {8}).size(), 1u);
  EXPECT_EQ(info_.dims, Index3(1));
  EXPECT_FALSE(make_surface(mesh_of(false, 0), {8}, ctx_));
}

TEST_F(VoxeliseColorTest, PictureCoordinatesOfAnySize) {
  for (const float uv : {1e6f, 1e20f, 3e38f}) {
    const auto voxels = draw(picture(16, 16,
                                     [](int64_t x, int64_t) {
                                       const auto value = static_cast<uint8_t>(x & 1 ? 255 : 0);
                                       return std::array<uint8_t, 4>{value, value, value, 255};
                                     }),
                             8, uv, {});
    EXPECT_EQ(voxels.size(), 64u);
    for (const auto& [place, color] : voxels) expect_near(color, stored(0.5), stored(0.5), stored(0.5));
  }
}

}  // namespace
}  // namespace voxkit::color
