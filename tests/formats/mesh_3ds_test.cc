// Meshes in 3DS files.
#include <cmath>

#include "tests/formats/mesh_file_test.h"
#include "tests/formats/studio_file.h"

namespace voxkit {
namespace {

using namespace studio_file;

class StudioTest : public MeshReadingTest {
 protected:
  static const MeshMaterial& material_of(const Mesh& mesh, size_t triangle) {
    return mesh.materials[mesh.triangles[triangle].material];
  }
  static glm::dvec3 corner(const Mesh& mesh, size_t triangle, size_t c) {
    return mesh.positions[mesh.triangles[triangle].vertices[c]];
  }
  static void expect_at(const glm::dvec3& have, const glm::dvec3& want) {
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(have[a], want[a], 1e-6) << "axis " << a;
  }
};

TEST_F(StudioTest, FacesAndMaterials) {
  Object object;
  object.groups = group("red", {0}) + group("half", {1});
  // Where light is written as a colour, black is none.
  const std::string scene =
      material("red", chunk(0xa020, color_24(255, 0, 0) + chunk(0x0012, "\x10\x10\x10"))) +
      material("half", chunk(0xa020, chunk(0x0010, floats({0, 0.5f, 2}))) +
                           chunk(0xa050, chunk(0x0030, u16(25))) + chunk(0xa080, color_24(0, 0, 0))) +
      object.chunks();
  const Mesh mesh = read("a.3ds", file(scene));
  ASSERT_EQ(mesh.triangles.size(), 2u);
  expect_box(mesh, {0, 0, 0}, {1, 1, 0});
  EXPECT_DOUBLE_EQ(area(mesh), 1);
  EXPECT_EQ(material_of(mesh, 0).color, glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(material_of(mesh, 0).alpha_mode, AlphaMode::opaque);
  const MeshMaterial& half = material_of(mesh, 1);
  EXPECT_NEAR(half.color.g, std::pow((0.5 + 0.055) / 1.055, 2.4), 1e-6);
  EXPECT_EQ(half.color.b, 1);
  EXPECT_EQ(half.color.a, 0.75f);
  EXPECT_EQ(half.alpha_mode, AlphaMode::blend);
  EXPECT_TRUE(mesh.notes.empty()) << mesh.notes[0];
}

TEST_F(StudioTest, ALinearColorAlone) {
  Object object;
  object.groups = group("gray", {0, 1});
  const Mesh mesh = read(
      "a.3ds",
      file(material("gray", chunk(0xa020, chunk(0x0013, floats({0.25f, 0.5f, NAN})))) + object.chunks()));
  EXPECT_EQ(material_of(mesh, 0).color, glm::vec4(0.25f, 0.5f, 0, 1));
}

TEST_F(StudioTest, FacesWithoutMaterialAreWhite) {
  Object object;
  object.groups = group("lost", {1});
  const Mesh mesh = read("a.3ds", file(object.chunks()));
  ASSERT_EQ(mesh.triangles.size(), 2u);
  for (size_t i : {0u, 1u}) EXPECT_EQ(material_of(mesh, i).color, glm::vec4(1));
  EXPECT_TRUE(has_note(mesh, "material lost is not in the file: white is taken"));
}

TEST_F(StudioTest, Textures) {
  picture("TEX.png");
  Object object;
  object.groups = group("plain", {0}) + group("moved", {1});
  const std::string name = chunk(0xa300, text("tex.PNG"));
  const std::string scene =
      material("plain", chunk(0xa020, color_24(9, 9, 9)) + chunk(0xa200, name + chunk(0xa351, u16(2)))) +
      material("moved", chunk(0xa200, chunk(0x0030, u16(100)) + name + chunk(0xa354, floats({2})) +
                                          chunk(0xa356, floats({3})) + chunk(0xa358, floats({0.25f})) +
                                          chunk(0xa35a, floats({-0.5f})))) +
      object.chunks();
  const Mesh mesh = read("a.3ds", file(scene));
  ASSERT_EQ(mesh.triangles.size(), 2u);
  ASSERT_EQ(mesh.pictures.size(), 1u);
  EXPECT_EQ(texel(mesh, 0, 1, 0), (std::array<int, 4>{0, 255, 0, 255}));
  // The texture takes the place of the colour.
  EXPECT_EQ(material_of(mesh, 0).color, glm::vec4(1));
  EXPECT_EQ(material_of(mesh, 0).wrap_u, PictureWrap::mirror);
  EXPECT_EQ(material_of(mesh, 1).wrap_u, PictureWrap::repeat);
  for (size_t t : {0u, 1u})
    for (const uint32_t v : mesh.triangles[t].vertices) {
      const glm::dvec3 p = mesh.positions[v];
      const double u = t == 0 ? p.x : 2 * p.x + 0.25, w = t == 0 ? p.y : 3 * p.y - 0.5;
      EXPECT_FLOAT_EQ(mesh.uvs[v].x, static_cast<float>(u));
      EXPECT_FLOAT_EQ(mesh.uvs[v].y, static_cast<float>(1 - w));
    }
  EXPECT_TRUE(mesh.notes.empty()) << mesh.notes[0];

  // Without picture coordinates the colour is seen.
  object.uvs.clear();
  const Mesh bare = read("b.3ds", file(scene.substr(0, scene.find("square") - 6) + object.chunks()));
  EXPECT_NEAR(material_of(bare, 0).color.r, 9 / 255.0 / 12.92, 1e-6);
  EXPECT_EQ(material_of(bare, 0).picture, -1);
  object.uvs = Object{}.uvs;
  const std::string lost = material("plain", chunk(0xa200, chunk(0xa300, text("none.tga"))));
  expect_error("c.3ds", file(lost + object.chunks()), "none.tga is missing");
}

TEST_F(StudioTest, NegativesAndOpacity) {
  picture("a.png");
  Object object;
  object.groups = group("m", {0, 1});
  const std::string name = chunk(0xa300, text("a.png"));
  const Mesh mesh =
      read("a.3ds", file(material("m", chunk(0xa200, name + chunk(0xa351, u16(4))) + chunk(0xa210, name)) +
                         object.chunks()));
  ASSERT_EQ(mesh.pictures.size(), 1u);
  // Red, green over blue, white: inverted, and as opaque as they are bright.
  const auto red = texel(mesh, 0, 0, 0), white = texel(mesh, 0, 1, 1);
  EXPECT_EQ(std::vector<int>(red.begin(), red.begin() + 3), (std::vector<int>{0, 255, 255}));
  EXPECT_NEAR(red[3], 76, 1);
  EXPECT_EQ(white, (std::array<int, 4>{0, 0, 0, 255}));
  EXPECT_EQ(material_of(mesh, 0).alpha_mode, AlphaMode::mask);
  EXPECT_TRUE(has_note(mesh, "opacity becomes yes or no"));
}

TEST_F(StudioTest, WhereNodesPutObjects) {
  Object object;
  // Local (x, y, z) is at (10 - y, x, z): its vertices are there.
  object.axes = {0, 1, 0, -1, 0, 0, 0, 0, 1, 10, 0, 0};
  object.places = {10, 0, 0, 10, 1, 0, 9, 1, 0, 9, 0, 0};
  expect_box(read("a.3ds", file(object.chunks())), {9, 0, 0}, {10, 1, 0});
  // Twice as long in x, then clockwise by a quarter about z: local (1, 0, 0) comes to (0, -2, 0).
  const auto quarter = static_cast<float>(std::acos(0.0));
  Node node;
  node.turn = {quarter, 0, 0, 5};
  node.scale = {2, 1, 1};
  node.place = {5, 6, 7};
  const Mesh mesh = read("b.3ds", file(object.chunks(), node.chunks()));
  ASSERT_EQ(mesh.triangles.size(), 2u);
  expect_at(corner(mesh, 0, 0), {5, 6, 7});
  expect_at(corner(mesh, 0, 1), {5, 4, 7});
  expect_at(corner(mesh, 0, 2), {6, 4, 7});
  // The pivot goes to where the node is.
  node.pivot = {1, 0, 0};
  const Mesh turned = read("c.3ds", file(object.chunks(), node.chunks()));
  expect_at(corner(turned, 0, 1), {5, 6, 7});
  expect_at(corner(turned, 0, 0), {5, 8, 7});
  EXPECT_TRUE(turned.notes.empty());
}

TEST_F(StudioTest, ParentsInstancesAndKeys) {
  const Object object;
  Node parent, near, far;
  parent.object = "$$$DUMMY";
  parent.id = 7;
  parent.place = {100, 0, 0};
  parent.scale = {1, 10, 1};
  parent.pivot = {9, 9, 9};  // of itself only
  near.id = 3;
  near.parent = 7;
  near.place = {0, 1, 0};
  far.id = 4;
  far.parent = 3;
  far.place = {0, 0, 5};
  // Children may come before their parents.
  const Mesh mesh = read("a.3ds", file(object.chunks(), far.chunks() + near.chunks() + parent.chunks()));
  ASSERT_EQ(mesh.triangles.size(), 4u);
  expect_box(mesh, {100, 10, 0}, {101, 20, 5});
  EXPECT_TRUE(mesh.notes.empty());

  near.keys = 2;
  near.parent = 99;
  const Mesh moving = read("b.3ds", file(object.chunks(), near.chunks()));
  expect_box(moving, {0, 1, 0}, {1, 2, 0});
  EXPECT_TRUE(has_note(moving, "key frames after the first, links to lights, cameras and what is not there"));

  near.parent = 4;
  expect_error("c.3ds", file(object.chunks(), far.chunks() + near.chunks()), "it is its own parent");
}

TEST_F(StudioTest, MirroredAxes) {
  Object object;
  // x of the object points to -x.
  object.axes = {-1, 0, 0, 0, 1, 0, 0, 0, 1, 4, 0, 0};
  object.places = {4, 0, 0, 3, 0, 0, 3, 1, 0, 4, 1, 0};
  // Among its axes they are 0 to 1 in x, which is mirrored.
  expect_box(read("a.3ds", file(object.chunks(), Node{}.chunks())), {-1, 0, 0}, {0, 1, 0});
  expect_box(read("b.3ds", file(object.chunks())), {4, 0, 0}, {5, 1, 0});
  object.axes = {1, 0, 0, 0, 1, 0, 0, 0, 0, 4, 0, 0};
  const Mesh flat = read("c.3ds", file(object.chunks(), Node{.place = {50, 0, 0}}.chunks()));
  expect_box(flat, {3, 0, 0}, {4, 1, 0});
  EXPECT_TRUE(has_note(flat, "axes of objects that are flat"));
}

TEST_F(StudioTest, WhatIsDroppedIsNamed) {
  Object object;
  object.more = chunk(0x4010, "");
  object.groups = group("m", {0, 1});
  const std::string scene =
      chunk(0x4000, text("lamp") + chunk(0x4600, floats({1, 2, 3}))) +
      chunk(0x4000, text("eye") + chunk(0x4700, std::string(32, '\0'))) +
      material("m", chunk(0xa030, color_24(1, 1, 1)) + chunk(0xa080, "") +
                        chunk(0xa230, chunk(0xa300, text("bumps.tga"))) + chunk(0xa33a, "")) +
      object.chunks();
  const Mesh mesh = read("a.3ds", file(scene) + "more");
  ASSERT_EQ(mesh.notes.size(), 1u);
  EXPECT_EQ(mesh.notes[0],
            "dropped: 4 bytes behind the file's own, bump maps, cameras, highlights, lights, second "
            "textures, self-illumination, that objects "
            "are hidden");
}

TEST_F(StudioTest, Refusals) {
  const auto with = [](const auto& change) {
    Object object;
    change(object);
    return file(object.chunks());
  };
  expect_error("a.3ds", with([](Object& o) { o.faces[1] = 4; }),
               "object square: face 0: vertex 4: there are 4");
  expect_error("a.3ds", with([](Object& o) { o.groups = group("m", {2}); }),
               "material m: face 2: there are 2");
  expect_error("a.3ds", with([](Object& o) { o.uvs.resize(6); }), "3 texture coordinates of 4 vertices");
  expect_error("a.3ds", with([](Object& o) { o.places[4] = NAN; }), "expected finite coordinates");
  expect_error("a.3ds", with([](Object& o) { o.faces.clear(); }), "a mesh without triangles");
  expect_error("a.3ds", "MM", "not a 3DS file");
  expect_error("a.3ds", obj_square(), "not a 3DS file");
  const std::string good = with([](Object&) {});
  expect_error("a.3ds", good.substr(0, good.size() - 1), "byte 0: chunk 4D4D of");
  std::string longer = good;
  longer[good.find("square") + 9] = 127;  // the length of the mesh, 0x4100
  expect_error("a.3ds", longer, "chunk 4100 of");
  std::string more = good;
  more[good.find("square") + 7 + 12] = 77;  // the number of vertices
  expect_error("a.3ds", more, "the chunk has");
}

}  // namespace
}  // namespace voxkit
