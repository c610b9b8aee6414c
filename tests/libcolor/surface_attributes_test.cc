// What voxels have beside colours, from meshes.
#include <cmath>
#include <glm/geometric.hpp>

#include "libcolor/surface/linear_light.h"
#include "libcolor/surface/octahedral.h"
#include "tests/libcolor/attribute_scenes.h"
#include "tests/libcolor/meshes.h"

namespace voxkit::color {
namespace {

const AttributeSet all = all_attributes();

/// A voxel and all that it has.
struct Voxel {
  Rgb color;
  Rgb emissive;
  int opacity = -1, roughness = -1, metalness = -1;
  std::array<float, 3> normal{};
  int64_t id = -1;
  std::vector<std::byte> bytes;
};
using ByPlace = std::map<uint64_t, Voxel>;

class SurfaceAttributesTest : public MeshTest {
 protected:
  ByPlace read(Mesh mesh, VoxeliseOptions options) {
    mesh.says_emission = mesh.says_rm = true;
    auto surface = make_surface(std::move(mesh), options, ctx_);
    EXPECT_TRUE(surface) << surface.error().what;
    ByPlace out;
    if (!surface) return out;
    notes_ = (*surface)->notes();
    attributes_ = (*surface)->attributes();
    const AttributeSet set = attributes_;
    const Status status = (*surface)->read(ctx_, [&](const VoxelRun& run) -> Status {
      EXPECT_EQ(run.attributes.size(), run.voxels.size() * set.bytes());
      for (size_t i = 0; i < run.voxels.size(); ++i) {
        EXPECT_TRUE(out.empty() || run.voxels[i].place > out.rbegin()->first);
        Voxel& voxel = out[run.voxels[i].place];
        voxel.color = run.voxels[i].color;
        const auto bytes = run.attributes.subspan(i * set.bytes(), set.bytes());
        voxel.bytes.assign(bytes.begin(), bytes.end());
        const auto at = [&](Attribute a, size_t k) {
          return std::to_integer<uint8_t>(bytes[set.offset(a) + k]);
        };
        if (set.has(Attribute::emissive))
          voxel.emissive = {at(Attribute::emissive, 0), at(Attribute::emissive, 1),
                            at(Attribute::emissive, 2)};
        if (set.has(Attribute::opacity)) voxel.opacity = at(Attribute::opacity, 0);
        if (set.has(Attribute::normal))
          voxel.normal = direction_of({at(Attribute::normal, 0), at(Attribute::normal, 1)});
        if (set.has(Attribute::rm))
          voxel.roughness = at(Attribute::rm, 0), voxel.metalness = at(Attribute::rm, 1);
        if (set.has(Attribute::id))
          voxel.id = at(Attribute::id, 0) | at(Attribute::id, 1) << 8 | at(Attribute::id, 2) << 16 |
                     int64_t{at(Attribute::id, 3)} << 24;
      }
      return {};
    });
    EXPECT_TRUE(status) << status.error().what;
    return out;
  }
  static void expect_normal(const Voxel& voxel, const glm::dvec3& n, double degrees = 1) {
    const glm::dvec3 unit = glm::normalize(n);
    const double cosine = unit.x * voxel.normal[0] + unit.y * voxel.normal[1] + unit.z * voxel.normal[2];
    EXPECT_GT(cosine, std::cos(degrees * 3.14159265 / 180))
        << voxel.normal[0] << " " << voxel.normal[1] << " " << voxel.normal[2];
  }
  /// Triangles of several materials, with all that a mesh may have.
  Mesh rich_mesh(int triangles) {
    Mesh mesh;
    std::uniform_real_distribution<double> place(0, 1);
    for (int i = 0; i < 4; ++i) {
      MeshMaterial m = plain(0.2f * static_cast<float>(i), 0.5f, 0.9f);
      m.number = static_cast<uint32_t>(10 - i);
      m.roughness = 0.25f * static_cast<float>(i);
      m.metalness = 0.5f;
      m.picture = i % 2 - 1;
      m.rm_picture = -(i % 2);
      if (i == 1) m.emission = {0.1f, 0.3f, 3}, m.emission_picture = 0;
      mesh.materials.push_back(m);
    }
    mesh.materials[2].alpha_mode = AlphaMode::blend;
    mesh.materials[2].color.a = 0.4f;
    mesh.materials[3].alpha_mode = AlphaMode::mask;
    mesh.pictures.push_back(picture(32, 32, [&](int64_t x, int64_t y) {
      return std::array<uint8_t, 4>{static_cast<uint8_t>(x * 7), static_cast<uint8_t>(y * 7), 99,
                                    static_cast<uint8_t>((x * y) % 256)};
    }));
    for (int i = 0; i < triangles; ++i) {
      const glm::dvec3 at(place(random_), place(random_), place(random_));
      const auto near = [&] { return at + 0.2 * glm::dvec3(place(random_), place(random_), place(random_)); };
      add_triangle(mesh, {{near(), near(), near()}}, static_cast<uint32_t>(i % 4),
                   {{{0, 0}, {3, 1}, {1, 2}}});
    }
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
      mesh.normals.push_back(i % 7 == 0 ? glm::vec3(0)
                                        : glm::vec3(place(random_) - 0.5, place(random_) - 0.5, 2));
      mesh.rm_uvs.push_back(glm::vec2(mesh.uvs[i].y, mesh.uvs[i].x));
    }
    return mesh;
  }
  Mesh copy_of(const Mesh& mesh) {
    Mesh out;
    out.positions = mesh.positions, out.uvs = mesh.uvs, out.rm_uvs = mesh.rm_uvs;
    out.normals = mesh.normals, out.triangles = mesh.triangles, out.materials = mesh.materials;
    for (const Picture& from : mesh.pictures)
      out.pictures.push_back(picture(from.width, from.height, [&](int64_t x, int64_t y) {
        std::array<uint8_t, 4> texel;
        std::memcpy(texel.data(), from.data() + 4 * (y * from.width + x), 4);
        return texel;
      }));
    return out;
  }

  std::vector<std::string> notes_;
  AttributeSet attributes_;
};

TEST_F(SurfaceAttributesTest, NormalsInTwoBytes) {
  std::normal_distribution<double> part;
  double worst = 1;
  for (int i = 0; i < 200000; ++i) {
    const glm::dvec3 n = glm::normalize(glm::dvec3(part(random_), part(random_), part(random_)));
    const auto back = direction_of(octahedral_of(5 * n.x, 5 * n.y, 5 * n.z));
    worst = std::min(worst, n.x * back[0] + n.y * back[1] + n.z * back[2]);
  }
  EXPECT_GT(worst, std::cos(1 * 3.14159265 / 180));
  EXPECT_EQ(octahedral_of(0, 0, 0), octahedral_of(0, 0, 1));
}

TEST_F(SurfaceAttributesTest, VoxelsAndColorsAreTheSameWithoutOpacity) {
  const Mesh mesh = rich_mesh(300);
  AttributeSet most = all;
  most.remove(Attribute::opacity);
  for (const SurfaceKind kind : {SurfaceKind::thin, SurfaceKind::conservative}) {
    const auto plain = by_place(voxelise(copy_of(mesh), {40, kind}));
    const auto rich = read(copy_of(mesh), {.resolution = 40, .kind = kind, .attributes = most});
    ASSERT_EQ(rich.size(), plain.size());
    for (const auto& [place, voxel] : rich) EXPECT_EQ(voxel.color, plain.at(place));
  }
}

TEST_F(SurfaceAttributesTest, CubesAndThreadsDoNotMatter) {
  const Mesh mesh = rich_mesh(300);
  ctx_.threads = 1;
  const auto want =
      read(copy_of(mesh), {.resolution = 24, .kind = SurfaceKind::conservative, .attributes = all});
  EXPECT_GT(want.size(), 1000u);
  for (const int bits : {0, 1, 3, 5}) {
    ctx_.threads = 1 + bits;
    const auto have =
        read(copy_of(mesh),
             {.resolution = 24, .kind = SurfaceKind::conservative, .tile_bits = bits, .attributes = all});
    ASSERT_EQ(have.size(), want.size());
    for (const auto& [place, voxel] : have) {
      EXPECT_EQ(voxel.color, want.at(place).color);
      EXPECT_EQ(voxel.bytes, want.at(place).bytes);
    }
  }
}

TEST_F(SurfaceAttributesTest, WhatComesByItself) {
  const auto with = [&](float alpha, AlphaMode mode, float light, bool emission) {
    Mesh mesh;
    mesh.materials = {plain(0.5f, 0, 0, alpha)};
    mesh.materials[0].alpha_mode = mode;
    mesh.materials[0].emission.r = light;
    add_square(mesh, 1);
    read(std::move(mesh), {.resolution = 4, .emission = emission});
    return attributes_;
  };
  EXPECT_EQ(with(1, AlphaMode::opaque, 0, true), AttributeSet());
  EXPECT_EQ(with(0.5f, AlphaMode::opaque, 0, true), AttributeSet());
  EXPECT_EQ(with(0.5f, AlphaMode::mask, 0, true), AttributeSet());
  EXPECT_EQ(with(1, AlphaMode::blend, 0, true), AttributeSet());
  EXPECT_EQ(with(0.5f, AlphaMode::blend, 0, true), set_of({Attribute::opacity}));
  EXPECT_EQ(with(1, AlphaMode::opaque, 1, true), set_of({Attribute::emissive}));
  EXPECT_EQ(with(1, AlphaMode::opaque, 1, false), AttributeSet());
  EXPECT_EQ(with(0.5f, AlphaMode::blend, 1, true), set_of({Attribute::emissive, Attribute::opacity}));
}

TEST_F(SurfaceAttributesTest, WhatThereIsNot) {
  const auto error = [&](AttributeSet wanted, bool emission) {
    Mesh mesh;
    mesh.materials = {plain(0.5f, 0, 0)};
    mesh.says_emission = true;
    add_square(mesh, 1);
    const auto surface =
        make_surface(std::move(mesh), {.resolution = 4, .emission = emission, .attributes = wanted}, ctx_);
    if (surface) return std::string();
    EXPECT_EQ(surface.error().code, ErrorCode::usage);
    return surface.error().what;
  };
  EXPECT_EQ(error(set_of({Attribute::emissive, Attribute::normal}), true), "");
  EXPECT_EQ(error(all, true),
            "attributes: it has no rm: expected some of color, emissive, opacity, normal, id");
  EXPECT_NE(error(set_of({Attribute::emissive}), false).find("emission is dropped"), std::string::npos);
}

TEST_F(SurfaceAttributesTest, LightThatIsEmitted) {
  Mesh mesh;
  mesh.materials = {plain(0.25f, 0, 0), plain(0, 1, 0)};
  mesh.materials[0].emission = {0.25f, 0.5f, 4};
  add_square(mesh, 1, 0, 0);
  add_square(mesh, 1, 1, 1);
  const auto stored = [](double light) { return light_tables().stored[std::lround(light * 65535)]; };
  for (const auto& [place, voxel] : read(std::move(mesh), {.resolution = 8})) {
    const bool lamp = morton_place(place).z == 0;
    EXPECT_EQ(voxel.emissive, lamp ? (Rgb{stored(0.25), stored(0.5), 255}) : Rgb());
    EXPECT_EQ(voxel.color, lamp ? (Rgb{stored(0.5), stored(0.5), 255}) : (Rgb{0, 255, 0}));
  }
}

TEST_F(SurfaceAttributesTest, HowMuchIsThere) {
  const auto opacities = [&](float alpha, bool backed) {
    Mesh mesh;
    mesh.materials = {plain(1, 0, 0, alpha), plain(0, 0, 1)};
    mesh.materials[0].alpha_mode = AlphaMode::blend;
    add_square(mesh, 1, 0);
    if (backed) add_square(mesh, 1, 1);
    const auto voxels = read(std::move(mesh), {.resolution = 4, .attributes = set_of({Attribute::opacity})});
    EXPECT_TRUE(notes_.empty());
    std::map<int, int> out;
    for (const auto& [place, voxel] : voxels) ++out[voxel.opacity];
    return out;
  };
  EXPECT_EQ(opacities(0.25f, false), (std::map<int, int>{{64, 16}}));
  EXPECT_EQ(opacities(0.005f, false), (std::map<int, int>{{1, 16}}));
  EXPECT_EQ(opacities(0.001f, false), (std::map<int, int>{}));
  EXPECT_EQ(opacities(1, false), (std::map<int, int>{{255, 16}}));
  EXPECT_EQ(opacities(0.25f, true), (std::map<int, int>{{255, 16}}));
}

TEST_F(SurfaceAttributesTest, EdgesOfMasks) {
  // A quarter of the texels is there: columns 0 to 3 of 16, which is one voxel and a fifth of five.
  Mesh mesh;
  add_square(mesh, 1, 0, 0, 1);
  mesh.materials = {plain(1, 1, 1, 0.8f)};
  mesh.materials[0].alpha_mode = AlphaMode::mask;
  mesh.materials[0].picture = 0;
  mesh.materials[0].wrap_u = mesh.materials[0].wrap_v = PictureWrap::clamp;
  mesh.pictures.push_back(picture(256, 256, [](int64_t x, int64_t) {
    // Above and below the cut-off after it is multiplied by 0.8.
    return std::array<uint8_t, 4>{static_cast<uint8_t>(x < 64 ? 40 : 200), 0, 0,
                                  static_cast<uint8_t>(x < 64 ? 160 : 159)};
  }));
  mesh.materials[0].alpha_cutoff = 160 * 0.8f / 255;
  const auto plain_voxels = voxelise(copy_of(mesh), {5}).size();
  EXPECT_LE(plain_voxels, 10u);
  const auto voxels = read(std::move(mesh), {.resolution = 5, .attributes = set_of({Attribute::opacity})});
  for (const auto& [place, voxel] : voxels) {
    const auto p = morton_place(place);
    EXPECT_LE(p.x, 2);
    if (p.x == 0) {
      EXPECT_GE(voxel.opacity, 220);
    } else if (p.x == 1) {
      EXPECT_NEAR(voxel.opacity, 64, 40);
    } else {
      EXPECT_LE(voxel.opacity, 16);
    }
    EXPECT_NEAR(voxel.color.r, 40, 1);  // what is cut off gives no colour
  }
  EXPECT_GE(voxels.size(), 10u);
}

TEST_F(SurfaceAttributesTest, NormalsOfFacesAndOfVertices) {
  const auto wanted = set_of({Attribute::normal});
  Mesh slope;
  slope.materials = {plain(1, 1, 1)};
  add_triangle(slope, {{{0, 0, 0}, {1, 0, 0.5}, {0, 1, 0}}});
  for (const auto& [place, voxel] : read(copy_of(slope), {.resolution = 16, .attributes = wanted}))
    expect_normal(voxel, {-0.5, 0, 1});
  // From one vertex to the others, the third without a normal is that of the face.
  slope.normals = {{0, 0, 3}, {1, 0, 0}, {0, 0, 1}};
  for (const auto& [place, voxel] : read(copy_of(slope), {.resolution = 16, .attributes = wanted})) {
    const auto p = morton_place(place);
    const double b = (p.x + 0.5) / 16;
    expect_normal(voxel, {b, 0, 1 - b}, 6);
  }
  slope.normals[1] = glm::vec3(0);
  for (const auto& [place, voxel] : read(copy_of(slope), {.resolution = 16, .attributes = wanted}))
    expect_normal(voxel, {-0.5, 0, 1});
  // Smaller than a step of the grid they are right all the same.
  Mesh tiny;
  tiny.materials = {plain(1, 1, 1)};
  add_triangle(tiny, {{{0, 0, 0}, {1e-5, 0, 1e-5}, {0, 1e-5, 0}}});
  add_triangle(tiny, {{{1, 1, 1}, {1 + 1e-5, 1, 1 + 1e-5}, {1, 1 + 1e-5, 1}}});
  const auto small =
      read(std::move(tiny), {.resolution = 8, .kind = SurfaceKind::conservative, .attributes = wanted});
  EXPECT_GE(small.size(), 2u);
  for (const auto& [place, voxel] : small) expect_normal(voxel, {-1, 0, 1});
}

TEST_F(SurfaceAttributesTest, NormalsAlongTheAxesOfVoxels) {
  // A grid whose x axis is along -y of the world, and whose second one along -x: mirrored or not by its
  // third.
  for (const double third : {1.0, -1.0}) {
    Mesh mesh;
    mesh.materials = {plain(1, 1, 1)};
    VolumeInfo grid;
    grid.dims = {8, 8, 8};
    grid.format = VoxelFormat::rgba32;
    grid.affine.axes = {{{0, -1, 0}, {-2, 0, 0}, {0, 0, third}}};
    mesh.grid = grid;
    add_triangle(mesh, {{{-1, -1, 2 * third}, {-6, -1.25, 3 * third}, {-2, -5, 2.5 * third}}});
    const glm::dvec3 n =
        glm::cross(mesh.positions[1] - mesh.positions[0], mesh.positions[2] - mesh.positions[0]);
    for (const bool given : {false, true}) {
      Mesh copy = copy_of(mesh);
      copy.grid = grid;
      if (given) copy.normals.assign(3, glm::vec3(n));
      const auto voxels = read(std::move(copy), {.attributes = set_of({Attribute::normal})});
      EXPECT_GT(voxels.size(), 4u);
      // What is along an axis of voxels is counted in their edges: a plane's normal goes the other way.
      for (const auto& [place, voxel] : voxels) expect_normal(voxel, {-n.y, -2 * n.x, third * n.z});
    }
  }
}

TEST_F(SurfaceAttributesTest, RoughnessAndMetalness) {
  Mesh mesh;
  mesh.materials = {plain(1, 1, 1), plain(1, 1, 1)};
  mesh.materials[0].roughness = 0.5f;
  mesh.materials[0].metalness = 1;
  mesh.materials[0].rm_picture = 0;
  mesh.materials[1].roughness = 0.2f;
  mesh.materials[1].metalness = 0.4f;
  mesh.pictures.push_back(picture(2, 2, [](int64_t, int64_t) {
    return std::array<uint8_t, 4>{9, 200, 100, 7};
  }));
  add_square(mesh, 1, 0, 0);
  add_square(mesh, 1, 1, 1);
  for (const auto& [place, voxel] :
       read(std::move(mesh), {.resolution = 8, .attributes = set_of({Attribute::rm})})) {
    const bool first = morton_place(place).z == 0;
    EXPECT_EQ(voxel.roughness, first ? 100 : 51);
    EXPECT_EQ(voxel.metalness, first ? 100 : 102);
  }
}

TEST_F(SurfaceAttributesTest, TheMaterialThatHasMost) {
  // Strips of a third and two thirds of a voxel.
  Mesh mesh;
  mesh.materials = {plain(1, 0, 0), plain(0, 1, 0)};
  mesh.materials[0].number = 3, mesh.materials[0].name = "red";
  mesh.materials[1].number = 70000;
  const auto strip = [&](double x0, double x1, uint32_t material) {
    add_triangle(mesh, {{{x0, 0, 0}, {x1, 0, 0}, {x0, 3, 0}}}, material);
    add_triangle(mesh, {{{x1, 3, 0}, {x0, 3, 0}, {x1, 0, 0}}}, material);
  };
  strip(0, 1.0 / 3, 0);
  strip(1.0 / 3, 1.4, 1);
  strip(1.4, 3, 0);
  const auto voxels = read(std::move(mesh), {.resolution = 3, .attributes = set_of({Attribute::id})});
  EXPECT_EQ(voxels.size(), 9u);
  for (const auto& [place, voxel] : voxels) {
    const uint32_t x = morton_place(place).x;
    EXPECT_EQ(voxel.id, x == 0 ? 70000 : 3);
  }
  EXPECT_EQ(notes_, (std::vector<std::string>{"materials: 3 = red, 70000 = (no name)"}));
  // Of equal ones the lowest number.
  Mesh twice;
  twice.materials = {plain(1, 0, 0), plain(0, 1, 0)};
  twice.materials[0].number = 5, twice.materials[1].number = 4;
  add_square(twice, 1, 0);
  add_square(twice, 1, 1);
  for (const auto& [place, voxel] :
       read(std::move(twice), {.resolution = 3, .attributes = set_of({Attribute::id})}))
    EXPECT_EQ(voxel.id, 4);
}

TEST_F(SurfaceAttributesTest, MeansOfAVoxel) {
  // Against sums of what is known: a voxel with a face and a slope of the square root of 2 in it.
  Mesh mesh;
  mesh.materials = {plain(0, 0, 0), plain(0, 0, 0)};
  mesh.materials[0].emission.r = 0.5f;
  mesh.materials[0].roughness = 0, mesh.materials[1].roughness = 1;
  mesh.materials[0].number = 0, mesh.materials[1].number = 1;
  add_triangle(mesh, {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}, 0);
  add_triangle(mesh, {{{1, 1, 0}, {0, 1, 0}, {1, 0, 0}}}, 0);
  add_triangle(mesh, {{{0, 0, 0}, {1, 0, 1}, {0, 1, 0}}}, 1);
  add_triangle(mesh, {{{1, 1, 1}, {0, 1, 0}, {1, 0, 1}}}, 1);
  const auto voxels =
      read(std::move(mesh), {.resolution = 1, .kind = SurfaceKind::conservative, .attributes = all});
  ASSERT_EQ(voxels.size(), 1u);
  const Voxel& voxel = voxels.begin()->second;
  const double root = std::sqrt(2.0);
  EXPECT_NEAR(voxel.emissive.r, light_tables().stored[std::lround(65535 * 0.5 / (1 + root))], 1);
  EXPECT_NEAR(voxel.roughness, 255 * root / (1 + root), 2);
  EXPECT_EQ(voxel.opacity, 255);
  EXPECT_EQ(voxel.id, 1);
  expect_normal(voxel, {-1, 0, 2});
}

}  // namespace
}  // namespace voxkit::color
