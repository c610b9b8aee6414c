// PLY files, which our own reader reads.
#include <gtest/gtest.h>

#include <algorithm>

#include "formats/image/image.h"
#include "formats/mesh/mesh.h"
#include "formats/mesh/mesh_ply.h"
#include "formats/module.h"
#include "tests/formats/file_format_test.h"
#include "tests/formats/mesh_files.h"

namespace voxkit {
namespace {

class MeshPlyTest : public FileFormatTest {
 protected:
  Mesh read(const std::string& content) {
    auto parts = read_ply(put("a.ply", content), ctx_);
    EXPECT_TRUE(parts) << parts.error().what;
    return parts ? std::move(parts->mesh) : Mesh{};
  }
  void expect_error(const std::string& content, const std::string& part, ErrorCode code = ErrorCode::input) {
    const auto mesh = read_mesh(put("a.ply", content), ctx_);
    ASSERT_FALSE(mesh) << "accepted; expected an error with: " << part;
    EXPECT_EQ(mesh.error().code, code);
    EXPECT_NE(mesh.error().what.find(part), std::string::npos) << mesh.error().what;
  }
};

TEST_F(MeshPlyTest, EveryTypeInEitherOrder) {
  const std::string properties =
      "element vertex 3\nproperty double x\nproperty short y\nproperty uint z\nproperty int8 pad\n"
      "property ushort green\nproperty uint8 red\nproperty float blue\nproperty float alpha\n"
      "element other 2\nproperty list uint16 double stuff\nproperty char more\n"
      "element face 1\nproperty uchar flag\nproperty list ushort uint32 vertex_index\nend_header\n";
  for (const bool big : {false, true}) {
    std::string data;
    const auto add = [&]<class T>(T value) { data += sample_text(std::vector<T>{value}, big); };
    for (int i = 0; i < 3; ++i) {
      add(1.5 * i), add(int16_t(-300 * i * i)), add(uint32_t(70000 + i)), add(int8_t(-1));
      add(uint16_t(65535)), add(uint8_t(0)), add(1.0f), add(0.25f);
    }
    add(uint16_t(2)), add(1.0), add(2.0), add(int8_t(3)), add(uint16_t(0)), add(int8_t(4));
    add(uint8_t(9)), add(uint16_t(3)), add(uint32_t(2)), add(uint32_t(0)), add(uint32_t(1));
    const Mesh mesh =
        read(fmt::format("ply\nformat binary_{}_endian 1.0\n", big ? "big" : "little") + properties + data);
    ASSERT_EQ(mesh.positions.size(), 3u);
    EXPECT_EQ(mesh.positions[2], glm::dvec3(3, -1200, 70002));
    EXPECT_EQ(mesh.colors[1], glm::vec4(0, 1, 1, 0.25f));
    EXPECT_EQ(mesh.materials[0].alpha_mode, AlphaMode::blend);
    ASSERT_EQ(mesh.triangles.size(), 1u);
    EXPECT_EQ(mesh.triangles[0].vertices, (std::array<uint32_t, 3>{2, 0, 1}));
  }
}

TEST_F(MeshPlyTest, PolygonsAndLineEnds) {
  const Mesh mesh = read(
      "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nelement vertex 5\r\nproperty float x\r\nproperty float "
      "y\r\n"
      "property float z\r\nelement face 2\r\nproperty list uchar int vertex_indices\r\nend_header\r\n"
      "0 0 0\r\n1 0 0\r\n1.5 +1 0\r\n1 2e0 0\r\n0 2 -0\r\n5 0 1 2 3 4\r\n2 0 1");
  ASSERT_EQ(mesh.triangles.size(), 3u);
  EXPECT_EQ(mesh.triangles[2].vertices, (std::array<uint32_t, 3>{0, 3, 4}));
  EXPECT_EQ(mesh.positions[2], glm::dvec3(1.5, 1, 0));
}

TEST_F(MeshPlyTest, PicturesOfMeshLab) {
  if (!load_module(module_folder(), {"image_stack", "reading images", ""})) GTEST_SKIP() << "no OpenImageIO";
  auto image = Image::create(2, 1, 1, SampleType::u8, ctx_);
  image->row(0)[0] = 10, image->row(0)[1] = 200;
  ASSERT_TRUE(write_image(path("two words.png"), *image, true));
  const std::string head =
      "ply\nformat ascii 1.0\ncomment TextureFile two words.png\nelement vertex 4\nproperty float x\n"
      "property float y\nproperty float z\n";
  // Coordinates of vertices, and of the corners of faces.
  auto mesh = read_mesh(put("a.ply", head + "property float s\nproperty float t\nelement face 1\n"
                                            "property list uchar int vertex_indices\nend_header\n"
                                            "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n4 0 1 2 3\n"),
                        ctx_);
  ASSERT_TRUE(mesh) << mesh.error().what;
  ASSERT_EQ(mesh->pictures.size(), 1u);
  EXPECT_EQ(mesh->pictures[0].data()[4], 200);
  EXPECT_EQ(mesh->uvs[2], glm::vec2(1, 0));  // from the top
  mesh = read_mesh(
      put("a.ply", head + "element face 2\nproperty list uchar int vertex_indices\n"
                          "property list uchar float texcoord\nend_header\n"
                          "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0.5 0.25 1 1 0 1\n"),
      ctx_);
  ASSERT_TRUE(mesh) << mesh.error().what;
  ASSERT_EQ(mesh->triangles.size(), 2u);
  const uint32_t corner = mesh->triangles[1].vertices[0];
  EXPECT_EQ(mesh->uvs[corner], glm::vec2(0.5f, 0.75f));
  EXPECT_EQ(mesh->positions[corner], glm::dvec3(0, 0, 0));
  EXPECT_EQ(mesh->uvs[mesh->triangles[0].vertices[0]], glm::vec2(0, 1));
}

TEST_F(MeshPlyTest, Refusals) {
  const auto file = [](const std::string& vertex, const std::string& face, const std::string& data) {
    return "ply\nformat ascii 1.0\nelement vertex " + vertex +
           "\nproperty float x\nproperty float y\nproperty float z\n" + face + "end_header\n" + data;
  };
  const std::string faces = "element face 1\nproperty list uchar int vertex_indices\n";
  const std::string points = "0 0 0\n1 0 0\n0 1 0\n";
  expect_error(file("0", "", ""), "without triangles");
  expect_error(file("3", "", points), "without triangles");
  expect_error(file("3", faces, points + "3 0 1 3\n"), "vertex 3: expected one below 3");
  expect_error(file("3", faces, points + "3 0 1 -1\n"), "expected one below 3");
  expect_error(file("3", faces, points + "3 0 1 1\n"), "without triangles");
  expect_error(file("3", faces, points + "255 0 1 2\n"), "a list of 255");
  expect_error(file("3", faces, points), "expected further elements");
  expect_error(file("99999999999", faces, points), "elements vertex");
  expect_error(file("-3", faces, points), "expected the number of elements");
  expect_error(file("3", faces, "0 0 x\n1 0 0\n0 1 0\n"), "expected a number");
  expect_error(file("3", faces, "0 0 nan\n1 0 0\n0 1 0\n3 0 1 2\n"), "expected finite coordinates");
  expect_error(file("3", "property string s\n" + faces, points), "expected the type of a property");
  expect_error("ply\nformat ascii 1.0\nelement face 1\n", "expected end_header");
  expect_error("ply\nformat EBCDIC 1.0\n", "expected the format");
  expect_error("ply\nend_header\n", "no format");
  expect_error("play", "not a PLY file");

  std::string many = "4000 ";
  for (int i = 0; i < 4000; ++i) many += "0 ";
  MemoryBudget small(20 << 10);
  ctx_.memory = &small;
  expect_error(file("3", "element face 1\nproperty list ushort int vertex_indices\n", points + many),
               "--max-memory", ErrorCode::limit);
}

TEST_F(MeshPlyTest, ColorsOfFaces) {
  const std::string vertices = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string faces =
      "element face 2\nproperty list uchar int vertex_indices\nproperty uchar red\n"
      "property uchar green\nproperty uchar blue\n";
  const std::string data = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n", two = "3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n";
  const auto check = [&](const Mesh& mesh) {
    ASSERT_EQ(mesh.triangles.size(), 2u);
    for (size_t i = 0; i < 2; ++i)
      for (const uint32_t v : mesh.triangles[i].vertices)
        EXPECT_EQ(mesh.colors[v], i ? glm::vec4(0, 0, 1, 1) : glm::vec4(1, 0, 0, 1));
  };
  check(read("ply\nformat ascii 1.0\n" + vertices + faces + "end_header\n" + data + two));
  // Faces before their vertices.
  check(read("ply\nformat ascii 1.0\n" + faces + vertices + "end_header\n" + two + data));
  // Vertices have colours, too: these count.
  const Mesh both =
      read("ply\nformat ascii 1.0\n" + vertices + "property int r\nproperty int g\nproperty int b\n" + faces +
           "end_header\n0 0 0 0 255 0\n1 0 0 0 255 0\n1 1 0 0 255 0\n0 1 0 0 255 0\n" + two);
  EXPECT_EQ(both.colors[0], glm::vec4(0, 1, 0, 1));
  ASSERT_EQ(both.notes.size(), 1u);
  EXPECT_NE(both.notes[0].find("colors of faces"), std::string::npos);
}

TEST_F(MeshPlyTest, Strips) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
      "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n1 2 0\n";
  const auto area = [](const Mesh& mesh) {
    double sum = 0;
    for (const MeshTriangle& t : mesh.triangles) {
      const glm::dvec3 u = mesh.positions[t.vertices[1]] - mesh.positions[t.vertices[0]],
                       v = mesh.positions[t.vertices[2]] - mesh.positions[t.vertices[0]];
      sum += (u.x * v.y - u.y * v.x) / 2;
    }
    return sum;
  };
  EXPECT_EQ(area(read(head + "6 0 1 2 3 4 5\n")), 2);
  EXPECT_EQ(area(read(head + "9 0 1 2 3 -1 2 3 4 5\n")), 2);
  expect_error(head + "3 0 1 6\n", "vertex 6: expected one below 6");
  expect_error(head + "3 0 1 -2\n", "expected one below 6");
}

TEST_F(MeshPlyTest, NamesOfColorsAndWhatIsDropped) {
  for (const char* names : {"r g b", "red green blue", "diffuse_red diffuse_green diffuse_blue"}) {
    std::string text(names), properties;
    for (size_t at = 0; at < text.size();) {
      const size_t end = std::min(text.find(' ', at), text.size());
      properties += "property uchar " + text.substr(at, end - at) + "\n";
      at = end + 1;
    }
    const Mesh mesh = read(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n" +
        properties +
        "property float nx\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0 255 0 0 1\n1 0 0 255 0 0 1\n0 1 0 255 0 0 1\n3 0 1 2\n");
    ASSERT_EQ(mesh.colors.size(), 3u) << names;
    EXPECT_EQ(mesh.colors[2], glm::vec4(1, 0, 0, 1));
    ASSERT_EQ(mesh.notes.size(), 1u);
    EXPECT_EQ(mesh.notes[0], "dropped: nx of vertex");
  }
}

TEST_F(MeshPlyTest, SeveralPictures) {
  const std::string head =
      "ply\nformat ascii 1.0\ncomment TextureFile a.png\ncomment TextureFile b.png\nelement vertex 3\n"
      "property float x\nproperty float y\nproperty float z\nelement face 2\n"
      "property list uchar int vertex_indices\nproperty list uchar float texcoord\n"
      "property int texnumber\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0 1 1\n";
  auto parts = read_ply(put("a.ply", head + "3 0 1 2 6 0 0 1 0 0 1 0\n"), ctx_);
  ASSERT_TRUE(parts);
  ASSERT_EQ(parts->maps.size(), 2u);
  EXPECT_EQ(parts->maps[parts->mesh.triangles[0].material].color.name, "b.png");
  EXPECT_EQ(parts->maps[parts->mesh.triangles[1].material].color.name, "a.png");
  expect_error(head + "3 0 1 2 6 0 0 1 0 0 1 2\n", "a face of texture 2: there are 2");
}

}  // namespace
}  // namespace voxkit
