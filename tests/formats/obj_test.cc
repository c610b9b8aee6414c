// Wavefront files as they are read: .obj and .mtl.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/formats/mesh_file_test.h"

namespace voxkit {
namespace {

class ObjTest : public MeshReadingTest {
 protected:
  Mesh read(const std::string& content) { return MeshReadingTest::read("a.obj", content); }
  const MeshMaterial& material_of(const Mesh& mesh, size_t triangle = 0) {
    return mesh.materials[mesh.triangles[triangle].material];
  }
};

TEST_F(ObjTest, NumbersAsPeopleWriteThem) {
  const Mesh mesh = read("v .5 -.5 +.5\nv 1. 1e0 5E-1\r\n\tv\t0  1\t.5   # a corner\nf 1 2 3\n");
  ASSERT_EQ(mesh.positions.size(), 3u);
  EXPECT_EQ(mesh.positions[0], glm::dvec3(0.5, -0.5, 0.5));
  EXPECT_EQ(mesh.positions[1], glm::dvec3(1, 1, 0.5));
  EXPECT_EQ(mesh.positions[2], glm::dvec3(0, 1, 0.5));
  // Doubles, and what is too small for them.
  EXPECT_EQ(read("v 500000.0625 1e-400 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").positions[0],
            glm::dvec3(500000.0625, 0, 0));
  expect_error("a.obj", "v 0 0 x\n", "line 1: v x: expected numbers");
  expect_error("a.obj", "v 0 0\n", "line 1: v: expected x, y and z");
  expect_error("a.obj", "v 0 0 0\nv 1 0 0\nv 1,5 0 0\n", "line 3");
}

TEST_F(ObjTest, CornersByNumber) {
  const std::string v = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
  for (const char* face : {"f 1 2 3 4\n", "f -4 -3 -2 -1\n", "f 1//1 2//1 3//1 4//1\nvn 0 0 1\n",
                           "fo 1 2 3 4\n", "f 1 2 \\\n3 4\n", "f 1 2 \\\r\n 3 4\n"}) {
    const Mesh mesh = read(v + face);
    EXPECT_EQ(mesh.triangles.size(), 2u) << face;
    EXPECT_EQ(area(mesh), 1) << face;
  }
  // Of vertices that come later.
  EXPECT_EQ(area(read("f 1 2 3 4\n" + v)), 1);
  // A comment ends with its line.
  EXPECT_EQ(area(read(v + "# C:\\\nf 1 2 3 4\n")), 1);
  for (const char* face :
       {"f 1 2 0\n", "f 1 2 5\n", "f 1 2 -5\n", "f 1 2 x\n", "f 1 2 /1\n", "f 1 2 99999999999999999999\n"})
    expect_error("a.obj", v + face, "line 5: ");
  expect_error("a.obj", v + "f 1 2 9\n", "line 5: 9: vertex 9: out of range: expected 1 to 4");
  expect_error("a.obj", v + "f 1 2 -5\n", "-5: vertex -5: out of range: expected -1 to -4, those before it");
  expect_error("a.obj", "f -1 2 3\n" + v, "out of range: there are none before it");
  expect_error("a.obj", "f 1 2 3\n", "1: vertex 1: out of range: the file has none");
}

TEST_F(ObjTest, CornersWithNumbersOfTextureCoordinatesThatAreNotThere) {
  const std::string v = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
  // None at all: the numbers say nothing, and the surface is there. With a picture that is said once more.
  for (const char* face : {"f 1/1/1 2/2/2 3/3/3 4/4/4\n", "f 1/1 2/2 3/3 4/4\n", "f 1/-1 2/-1 3/-1 4/-1\n"}) {
    const Mesh mesh = read(v + face);
    EXPECT_EQ(area(mesh), 1) << face;
    EXPECT_TRUE(mesh.uvs.empty());
    EXPECT_TRUE(has_note(mesh, "dropped: numbers of texture coordinates at corners")) << face;
  }
  EXPECT_TRUE(read(v + "f 1//1 2//1 3//1 4//1\n").notes.empty());
  // Too few: the file is damaged, and its picture would lie elsewhere.
  expect_error("a.obj", v + "vt 0 0\nvt 1 0\nf 1/1 2/2 3/3\n",
               "line 7: 3/3: texture coordinates 3: out of range: expected 1 to 2");
}

TEST_F(ObjTest, PointsLinesAndWhatElseThereIs) {
  const Mesh mesh =
      read("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nf 1 2 3\np 4 1\nl 1 2\ncurv 0 1 1 2\ng a\no b\ns 1\n");
  EXPECT_EQ(mesh.triangles.size(), 1u);
  EXPECT_EQ(mesh.points.size(), 2u);
  EXPECT_TRUE(has_note(mesh, "lines"));
  EXPECT_TRUE(has_note(mesh, "free-form"));
  EXPECT_TRUE(read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").notes.empty());
}

TEST_F(ObjTest, ColorsOfVertices) {
  const Mesh mesh = read("v 0 0 0\nv 1 0 0 1 0.5 0\nv 0 1 0 1\nv 1 1 0 0 0 1 0.25\nf 1 2 3\nf 2 3 4\n");
  ASSERT_EQ(mesh.colors.size(), 4u);
  EXPECT_EQ(mesh.colors[0], glm::vec4(1));
  EXPECT_EQ(mesh.colors[1].r, 1);
  EXPECT_NEAR(mesh.colors[1].g, 0.21404, 1e-4);
  EXPECT_EQ(mesh.colors[2], glm::vec4(1));  // a weight
  EXPECT_EQ(mesh.colors[3].a, 0.25f);
  EXPECT_EQ(material_of(mesh).alpha_mode, AlphaMode::blend);
  EXPECT_TRUE(has_note(read("v 0 0 0 255 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "above 1"));
}

TEST_F(ObjTest, SeveralLibraries) {
  put("a1.mtl", "newmtl a\nKd 1 0 0\nnewmtl both\nKd 1 0 0\n");
  put("b1.mtl", "newmtl b\nKd 0 0 1\nnewmtl both\nKd 0 0 1\n");
  put("with space.mtl", "newmtl b\nKd 0 1 0\n");
  EXPECT_EQ(material_of(read(obj_square("mtllib a1.mtl b1.mtl\nusemtl b\n"))).color, glm::vec4(0, 0, 1, 1));
  EXPECT_EQ(material_of(read(obj_square("mtllib a1.mtl\nmtllib b1.mtl\nusemtl b\n"))).color,
            glm::vec4(0, 0, 1, 1));
  EXPECT_EQ(material_of(read(obj_square("mtllib a1.mtl b1.mtl\nusemtl both\n"))).color,
            glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(material_of(read(obj_square("mtllib with space.mtl\nusemtl b\n"))).color, glm::vec4(0, 1, 0, 1));
  expect_error("a.obj", obj_square("mtllib a1.mtl lost.mtl\nusemtl a\n"), "lost.mtl is missing");
  EXPECT_TRUE(has_note(read(obj_square("mtllib a1.mtl\nusemtl c\n")), "material c is in none"));
  // The mesh was renamed, its library with it.
  put("a.mtl", "newmtl a\nKd 0 1 1\n");
  const Mesh renamed = read(obj_square("mtllib lost.mtl\nusemtl a\n"));
  EXPECT_EQ(material_of(renamed).color, glm::vec4(0, 1, 1, 1));
  EXPECT_TRUE(has_note(renamed, "lost.mtl is missing: a.mtl is taken"));
}

TEST_F(ObjTest, OpacityAndEmission) {
  const auto with = [&](const std::string& lines) {
    put("m.mtl", "newmtl a\n" + lines);
    return material_of(read(obj_square("mtllib m.mtl\nusemtl a\n")));
  };
  EXPECT_EQ(with("").color, glm::vec4(1));
  EXPECT_EQ(with("Kd 1\n").color, glm::vec4(1));
  EXPECT_EQ(with("Tr 1\n").color.a, 0);
  EXPECT_EQ(with("Tr 0.25\n").color.a, 0.75f);
  EXPECT_EQ(with("Tr 0.25\n").alpha_mode, AlphaMode::blend);
  EXPECT_EQ(with("d .5\n").color.a, 0.5f);
  EXPECT_EQ(with("d -halo .5\n").color.a, 0.5f);
  // Where there are both, d counts: some write 1 in both.
  EXPECT_EQ(with("d 1\nTr 1\n").color.a, 1);
  EXPECT_EQ(with("Tr 1\nd 1\n").color.a, 1);
  EXPECT_EQ(with("Tr 1\nd 1\n").alpha_mode, AlphaMode::opaque);
  EXPECT_EQ(with("Ke 0 1 0\n").emission, glm::vec3(0, 1, 0));
  EXPECT_GT(with("Ke 0 2 0\n").emission.g, 2);
  EXPECT_FALSE(with("Ke 0 0 0\n").emits());
  put("m.mtl", "Kd 1 0 0\n");
  expect_error("a.obj", obj_square("mtllib m.mtl\n"), "expected newmtl before");
  put("m.mtl", "newmtl a\nKd spectral a.rfl\n");
  expect_error("a.obj", obj_square("mtllib m.mtl\n"), "line 2: kd spectral: expected red, green and blue");
}

TEST_F(ObjTest, OptionsOfMaps) {
  if (!reads_images()) GTEST_SKIP() << "no OpenImageIO";
  picture("f.png");
  picture("a name.png");
  const auto with = [&](const std::string& lines) {
    put("m.mtl", "newmtl a\n" + lines);
    return read(obj_square("mtllib m.mtl\nusemtl a\n"));
  };
  const Mesh part = with("map_Kd -s 0.125 .5 1 -o 0.875 0.25 0 f.png\n");
  for (size_t i = 0; i < part.positions.size(); ++i) {
    EXPECT_EQ(part.uvs[i].x, 0.125 * part.positions[i].x + 0.875);
    EXPECT_EQ(part.uvs[i].y, 1 - (0.5 * part.positions[i].y + 0.25));
  }
  const Mesh one = with("map_Kd -s 2 f.png\n");
  for (size_t i = 0; i < one.positions.size(); ++i)
    EXPECT_EQ(one.uvs[i], glm::vec2(2 * one.positions[i].x, 1 - one.positions[i].y));
  EXPECT_EQ(material_of(with("map_Kd -clamp on f.png\n")).wrap_u, PictureWrap::clamp);
  EXPECT_EQ(material_of(with("map_Kd -clamp off -blendu on -texres 64 -bm 1 f.png\n")).wrap_u,
            PictureWrap::repeat);
  for (const char* name : {"a name.png", "\"a name.png\"", "-clamp on a name.png"})
    EXPECT_EQ(with(fmt::format("map_Kd {}\n", name)).pictures.size(), 1u) << name;
  // Half of the range, from a quarter on.
  EXPECT_EQ(texel(with("map_Kd -mm 0.25 0.5 f.png\n"), 0, 0, 0), (std::array<int, 4>{191, 64, 64, 255}));
  // A channel of an opacity map.
  EXPECT_EQ(texel(with("map_Kd f.png\nmap_d -imfchan g f.png\n"), 0, 1, 0)[3], 255);
  EXPECT_EQ(texel(with("map_Kd f.png\nmap_d -imfchan g f.png\n"), 0, 0, 1)[3], 0);
  EXPECT_TRUE(has_note(with("map_Kd f.png\nbump f.png\n"), "bump"));
  EXPECT_TRUE(has_note(with("map_Kd -t 1 1 f.png\n"), "-t of maps"));
  expect_error("a.obj", obj_square((put("m.mtl", "newmtl a\nmap_Kd -s\n"), "mtllib m.mtl\n")), "line 2: -s");
  expect_error("a.obj",
               obj_square((put("m.mtl", "newmtl a\nmap_Kd f.png\nmap_d -s 2 2 f.png\n"), "mtllib m.mtl\n")),
               "map_d has other options");
  // What emits, by its own map: a map alone is seen.
  const Mesh lamp = with("Kd 0 0 0\nmap_Kd f.png\nmap_Ke -o 3 f.png\n");
  EXPECT_EQ(material_of(lamp).emission, glm::vec3(1));
  EXPECT_EQ(material_of(lamp).emission_picture, 0);
  ASSERT_EQ(lamp.emission_uvs.size(), lamp.uvs.size());
  EXPECT_EQ(lamp.emission_uvs[0].x, lamp.uvs[0].x + 3);
  // Faces without coordinates go without their picture, and that is said.
  put("m.mtl", "newmtl a\nKd 0 1 0\nmap_Kd f.png\n");
  const Mesh mixed = read(obj_square("mtllib m.mtl\nusemtl a\n") + "f 1 2 3\n");
  EXPECT_EQ(material_of(mixed, 0).picture, 0);
  EXPECT_EQ(material_of(mixed, 2).picture, -1);
  EXPECT_EQ(material_of(mixed, 2).color, glm::vec4(0, 1, 0, 1));
  EXPECT_TRUE(has_note(mixed, "texture coordinates"));
}

TEST_F(ObjTest, HugePolygons) {
  // A convex one and a star of 300,000 corners: each in linear time.
  constexpr int corners = 300000;
  for (const bool star : {false, true}) {
    std::string text, face = "f";
    double want = 0, before_x = 0, before_y = 0;
    for (int i = 0; i <= corners; ++i) {
      const double angle = 2 * M_PI * (i % corners) / corners, r = star && i % 2 ? 0.5 : 1;
      const double x = std::round(1e9 * r * std::cos(angle)) / 1e9,
                   y = std::round(1e9 * r * std::sin(angle)) / 1e9;
      if (i) want += (before_x * y - before_y * x) / 2;
      before_x = x, before_y = y;
      if (i == corners) break;
      text += fmt::format("v {} {} 0\n", x, y);
      face += fmt::format(" {}", i + 1);
    }
    const Mesh mesh = read(text + face + "\n");
    EXPECT_NEAR(area(mesh), want, 1e-6) << star;
    EXPECT_GT(mesh.triangles.size(), corners / 2u);
  }
}

}  // namespace
}  // namespace voxkit
