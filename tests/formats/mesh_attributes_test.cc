// What files of meshes and points say beside places and colours.
#include <glm/geometric.hpp>

#include "formats/mesh/point_cloud.h"
#include "tests/formats/mesh_file_test.h"
#include "tests/formats/point_files.h"

namespace voxkit {
namespace {

class MeshAttributesTest : public MeshReadingTest {
 protected:
  Mesh read_all(const std::string& name, const std::string& content) {
    auto mesh = read_mesh(put(name, content), ctx_, {.normals = true, .rm = true});
    EXPECT_TRUE(mesh) << mesh.error().what;
    return mesh ? std::move(*mesh) : Mesh{};
  }
  static void expect_near(const glm::vec3& have, const glm::vec3& want) {
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(have[c], want[c], 1e-5) << c;
  }
  struct Points {
    std::vector<CloudPoint> points;
    std::vector<std::string> notes;
    PointExtras has;
  };
  Points points_of(const std::string& name, const std::string& content, const PointExtras& wanted) {
    const auto cloud = open_points(put(name, content), wanted);
    EXPECT_TRUE(cloud) << cloud.error().what;
    Points out;
    if (!cloud) return out;
    out.notes = (*cloud)->notes();
    out.has = (*cloud)->has();
    EXPECT_TRUE((*cloud)->read([&](std::span<const CloudPoint> run) -> Status {
      out.points.insert(out.points.end(), run.begin(), run.end());
      return {};
    }));
    return out;
  }
};

TEST_F(MeshAttributesTest, NormalsOfGltfGoWithTheirNodes) {
  GltfFile file;
  const int normals = file.numbers<float>({0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0}, 5126, "VEC3");
  const int places = file.square(), corners = file.square_corners();
  file.primitives =
      fmt::format(R"({{"attributes":{{"POSITION":{},"NORMAL":{}}},"indices":{}}})", places, normals, corners);
  // Twice as long along z, and mirrored along x.
  file.nodes = R"([{"mesh":0,"scale":[-1,1,2]}])";
  const Mesh mesh = read_all("a.gltf", file.json());
  ASSERT_EQ(mesh.normals.size(), 4u);
  expect_near(mesh.normals[0], {0, 0, 1});
  expect_near(mesh.normals[1], {-1, 0, 0});
  expect_near(mesh.normals[2], glm::normalize(glm::vec3(0, 1, 0.5f)));
  expect_near(mesh.normals[3], {0, 0, 0});
  EXPECT_EQ(read("a.gltf", file.json()).normals.size(), 0u);
}

TEST_F(MeshAttributesTest, RoughnessOfGltf) {
  GltfFile file;
  const int places = file.square(), corners = file.square_corners();
  file.primitives = fmt::format(R"({{"attributes":{{"POSITION":{0}}},"indices":{1},"material":0}},)"
                                R"({{"attributes":{{"POSITION":{0}}},"indices":{1},"material":1}},)"
                                R"({{"attributes":{{"POSITION":{0}}},"indices":{1},"material":2}},)"
                                R"({{"attributes":{{"POSITION":{0}}},"indices":{1}}})",
                                places, corners);
  file.materials =
      R"({"name":"steel","pbrMetallicRoughness":{"metallicFactor":0.75,"roughnessFactor":0.25}},{"name":"none"},)"
      R"({"extensions":{"KHR_materials_pbrSpecularGlossiness":{"glossinessFactor":0.75}}})";
  const Mesh mesh = read_all("a.gltf", file.json());
  ASSERT_EQ(mesh.materials.size(), 4u);
  EXPECT_TRUE(mesh.says_rm);
  EXPECT_EQ(mesh.materials[0].metalness, 0.75f);
  EXPECT_EQ(mesh.materials[0].roughness, 0.25f);
  for (const size_t i : {1, 3}) {
    EXPECT_EQ(mesh.materials[i].metalness, 1);
    EXPECT_EQ(mesh.materials[i].roughness, 1);
  }
  EXPECT_EQ(mesh.materials[2].metalness, 0);
  EXPECT_EQ(mesh.materials[2].roughness, 0.25f);
  for (uint32_t i = 0; i < 4; ++i) EXPECT_EQ(mesh.materials[i].number, i);
  EXPECT_FALSE(has_note(mesh, "metal and roughness"));
  EXPECT_TRUE(has_note(read("a.gltf", file.json()), "metal and roughness"));
}

TEST_F(MeshAttributesTest, PicturesOfRoughness) {
  if (!reads_images()) GTEST_SKIP() << "no images";
  const std::string image = picture("p.png");
  GltfFile file;
  const int view = file.view(image);
  const int places = file.square(), corners = file.square_corners();
  const int uvs = file.numbers<float>({0, 1, 1, 1, 1, 0, 0, 0}, 5126, "VEC2");
  const int others = file.numbers<float>({0, 0, 0.5f, 0, 0.5f, 1, 0, 1}, 5126, "VEC2");
  file.primitives = fmt::format(
      R"({{"attributes":{{"POSITION":{},"TEXCOORD_0":{},"TEXCOORD_1":{}}},"indices":{},"material":0}})",
      places, uvs, others, corners);
  file.materials =
      R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0},"metallicRoughnessTexture":{"index":0,"texCoord":1}}})";
  file.rest = fmt::format(
      R"(,"images":[{{"bufferView":{},"mimeType":"image/png"}}],"samplers":[{{"wrapS":33071,"magFilter":9728}}],)"
      R"("textures":[{{"source":0,"sampler":0}}])",
      view);
  const Mesh mesh = read_all("a.gltf", file.json());
  ASSERT_EQ(mesh.materials.size(), 1u);
  ASSERT_GE(mesh.materials[0].rm_picture, 0);
  EXPECT_EQ(mesh.materials[0].rm_wrap_u, PictureWrap::clamp);
  EXPECT_EQ(mesh.materials[0].rm_filter, PictureFilter::nearest);
  ASSERT_EQ(mesh.rm_uvs.size(), 4u);
  EXPECT_EQ(mesh.rm_uvs[1], glm::vec2(0.5f, 0));
  EXPECT_EQ(mesh.uvs[1], glm::vec2(1, 1));
  const Mesh plain = read("a.gltf", file.json());
  EXPECT_EQ(plain.materials[0].rm_picture, -1);
  EXPECT_TRUE(plain.rm_uvs.empty());
  EXPECT_TRUE(has_note(plain, "maps of metal and roughness"));
}

TEST_F(MeshAttributesTest, NormalsOfObj) {
  const std::string places = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n", normals = "vn 0 0 1\nvn 0 3 0\n";
  // A place with two normals is two vertices.
  const Mesh mesh = read_all("a.obj", places + normals + "f 1//1 2//1 3//2\nf 1//2 3//-1 4\n");
  ASSERT_EQ(mesh.triangles.size(), 2u);
  const auto normal = [&](const Mesh& of, size_t triangle, size_t corner) {
    return of.normals.at(of.triangles[triangle].vertices[corner]);
  };
  EXPECT_EQ(normal(mesh, 0, 0), glm::vec3(0, 0, 1));
  EXPECT_EQ(normal(mesh, 0, 2), glm::vec3(0, 3, 0));
  EXPECT_EQ(normal(mesh, 1, 0), glm::vec3(0, 3, 0));
  EXPECT_EQ(normal(mesh, 1, 1), glm::vec3(0, 3, 0));
  EXPECT_EQ(normal(mesh, 1, 2), glm::vec3(0));
  EXPECT_EQ(mesh.triangles[0].vertices[2], mesh.triangles[1].vertices[1]);
  // With picture coordinates, and with numbers of some that there are not.
  const Mesh both = read_all("a.obj", places + "vt 0 0\nvt 1 0\n" + normals + "f 1/1/1 2/2/1 3/1/2\n");
  EXPECT_EQ(normal(both, 0, 2), glm::vec3(0, 3, 0));
  EXPECT_EQ(both.uvs.at(both.triangles[0].vertices[1]), glm::vec2(1, 1));
  const Mesh lacking = read_all("a.obj", places + normals + "f 1/7/1 2/8/1 3/90/2\n");
  EXPECT_EQ(normal(lacking, 0, 2), glm::vec3(0, 3, 0));
  // Without being asked for they do not matter.
  EXPECT_TRUE(read("a.obj", places + normals + "f 1//1 2//9 3//2\n").normals.empty());
  const auto bad = read_mesh(put("a.obj", places + normals + "f 1//1 2//9 3//2\n"), ctx_, {.normals = true});
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().what.find("normal 9: out of range: expected 1 to 2"), std::string::npos)
      << bad.error().what;
}

TEST_F(MeshAttributesTest, RoughnessOfMtl) {
  put("m.mtl", "newmtl a\nPr 0.25\nPm 0.5\nnewmtl b\nKd 1 1 1\n");
  const std::string text = obj_square("mtllib m.mtl\nusemtl a\n") + "usemtl b\nf 1/1 2/2 3/3\n";
  const Mesh mesh = read_all("a.obj", text);
  ASSERT_EQ(mesh.materials.size(), 2u);
  EXPECT_EQ(mesh.materials[0].roughness, 0.25f);
  EXPECT_EQ(mesh.materials[0].metalness, 0.5f);
  EXPECT_EQ(mesh.materials[1].roughness, 1);
  EXPECT_FALSE(has_note(mesh, "pr"));
  EXPECT_TRUE(has_note(read("a.obj", text), "pr"));
}

TEST_F(MeshAttributesTest, NumbersOfMaterialsStayWithTheirCopies) {
  if (!reads_images()) GTEST_SKIP() << "no images";
  picture("p.png");
  put("m.mtl", "newmtl a\nmap_Kd p.png\nnewmtl b\nKd 1 1 1\n");
  const Mesh mesh =
      read("a.obj", obj_square("mtllib m.mtl\nusemtl a\n") + "f 1 2 3\nusemtl b\nf 1/1 2/2 4/4\n");
  ASSERT_EQ(mesh.triangles.size(), 4u);
  const auto number = [&](size_t i) { return mesh.materials[mesh.triangles[i].material].number; };
  EXPECT_NE(mesh.triangles[0].material, mesh.triangles[2].material);
  EXPECT_EQ(number(0), 0u);
  EXPECT_EQ(number(2), 0u);
  EXPECT_EQ(number(3), 1u);
}

const std::string head = "ply\nformat ascii 1.0\n";
const std::string places = "property float x\nproperty float y\nproperty float z\n";
const std::string normals = "property float nx\nproperty float ny\nproperty float nz\n";

TEST_F(MeshAttributesTest, NormalsOfPlyMeshes) {
  const std::string text = head + "element vertex 3\n" + places + normals + "property int label\n" +
                           "element face 1\nproperty list uchar int vertex_indices\nend_header\n" +
                           "0 0 0 0 0 1 5\n1 0 0 0 2 0 5\n0 1 0 nan 0 1 5\n3 0 1 2\n";
  const Mesh mesh = read_all("a.ply", text);
  EXPECT_EQ(mesh.normals, (std::vector<glm::vec3>{{0, 0, 1}, {0, 2, 0}, {0, 0, 0}}));
  EXPECT_TRUE(has_note(mesh, "dropped: label of vertex"));
  EXPECT_TRUE(
      has_note(read("a.ply", text), "dropped: nx of vertex, ny of vertex, nz of vertex, label of vertex"));
}

TEST_F(MeshAttributesTest, PlyPoints) {
  const std::string text =
      head + "element vertex 3\n" + places + normals +
      "property uchar red\nproperty uchar green\nproperty uchar blue\n" +
      "property uchar alpha\nproperty float roughness\nproperty uchar metallic\n" +
      "property float scalar_Classification\nproperty int label\nproperty float intensity\n" +
      "end_header\n0 0 0 0 0 2 1 2 3 255 0.5 51 6 9 1\n1 0 0 0 1 0 1 2 3 20 1 0 -1 9 1\n" +
      "2 0 0 0 1 0 1 2 3 0 1 0 -1 9 1\n";
  const Points all = points_of("a.ply", text, {true, true, true, true});
  ASSERT_EQ(all.points.size(), 2u);
  EXPECT_EQ(all.points[0].normal, glm::vec3(0, 0, 2));
  EXPECT_EQ(all.points[0].roughness, 128);
  EXPECT_EQ(all.points[0].metalness, 51);
  EXPECT_EQ(all.points[0].label, 6u);
  EXPECT_EQ(all.points[1].alpha, 20);
  EXPECT_EQ(all.points[1].label, UINT32_MAX);
  EXPECT_EQ(all.notes, (std::vector<std::string>{"dropped: label of vertex, intensity of vertex"}));
  const Points plain = points_of("a.ply", text, {});
  EXPECT_EQ(plain.points.size(), 1u);
  EXPECT_EQ(plain.points[0].normal, glm::vec3(0));
  EXPECT_EQ(plain.points[0].label, 0u);
  EXPECT_TRUE(plain.has.alpha && plain.has.normals && plain.has.rm && plain.has.labels);
  EXPECT_EQ(plain.notes, (std::vector<std::string>{
                             "dropped: nx of vertex, ny of vertex, nz of vertex, roughness of vertex, "
                             "metallic of vertex, scalar_Classification of vertex, label of vertex, "
                             "intensity of vertex"}));
}

TEST_F(MeshAttributesTest, IntensityOfPlyPointsWithoutColors) {
  const std::string text = head + "element vertex 3\n" + places + "property float intensity\nend_header\n";
  const Points grays = points_of("a.ply", text + "0 0 0 0\n1 0 0 5\n2 0 0 nan\n", {});
  ASSERT_EQ(grays.points.size(), 3u);
  EXPECT_EQ(grays.points[1].color, (std::array<uint8_t, 3>{255, 255, 255}));
  EXPECT_EQ(grays.points[0].color, (std::array<uint8_t, 3>{0, 0, 0}));
  EXPECT_EQ(grays.points[2].color, (std::array<uint8_t, 3>{0, 0, 0}));
  EXPECT_EQ(grays.notes, (std::vector<std::string>{"no colors: intensity, 0 to 5, is taken as gray"}));
  const Points white = points_of("a.ply", text + "0 0 0 0\n1 0 0 0\n2 0 0 0\n", {});
  EXPECT_EQ(white.points[1].color, (std::array<uint8_t, 3>{255, 255, 255}));
}

TEST_F(MeshAttributesTest, ClassesOfLasPoints) {
  LasFile file;
  file.points = {{{1, 2, 3}, {1000, 0, 0}, 0, 0x45}, {{1, 2, 4}, {1000, 0, 0}, 0, 2}};
  for (const int format : {2, 7}) {
    file.format = format;
    file.minor = format >= 6 ? 4 : 2;
    const Points classes = points_of("a.las", file.text(), {.labels = true});
    ASSERT_EQ(classes.points.size(), format == 2 ? 2u : 1u);  // the bit of 4 is: withheld
    EXPECT_EQ(classes.points.back().label, format == 2 ? 2u : 7u);
    if (format == 2) {
      EXPECT_EQ(classes.points[0].label, 5u);
    }
    EXPECT_TRUE(classes.has.labels);
    for (const std::string& note : classes.notes) EXPECT_EQ(note.find("classification"), std::string::npos);
    EXPECT_EQ(points_of("a.las", file.text(), {}).points.back().label, 0u);
  }
}

}  // namespace
}  // namespace voxkit
