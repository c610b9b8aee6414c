// What glTF 2.0 and the extensions that are understood say, as it is read.
#include <gtest/gtest.h>

#include "tests/formats/mesh_file_test.h"

namespace voxkit {
namespace {

/// A square with what is asked for.
struct Square : GltfFile {
  int position = square(), corners = square_corners();
  Square() { use({}); }
  /// Further attributes: ,"COLOR_0":3
  void use(const std::string& attributes, const std::string& members = "") {
    primitives = fmt::format(R"({{"attributes":{{"POSITION":{}{}}},"indices":{},"material":0{}}})", position,
                             attributes, corners, members);
    if (materials.empty()) materials = "{}";
  }
};

class GltfTest : public MeshReadingTest {
 protected:
  Mesh read(const GltfFile& file) { return MeshReadingTest::read("a.gltf", file.json()); }
};

TEST_F(GltfTest, PictureCoordinatesOfEachType) {
  if (!reads_images()) GTEST_SKIP() << "no OpenImageIO";
  picture("a.png");
  const auto check = [&](int component, const std::string& bytes, const std::string& more,
                         const std::string& of_view = "") {
    Square file;
    const int uv = file.accessor(bytes, component, 4, "VEC2", more, of_view);
    file.use(fmt::format(R"(,"TEXCOORD_0":{})", uv));
    file.materials = R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}})";
    file.rest = R"(,"textures":[{"source":0}],"images":[{"uri":"a.png"}])";
    const Mesh mesh = read(file);
    ASSERT_EQ(mesh.uvs.size(), 4u);
    for (size_t i = 0; i < 4; ++i) {
      EXPECT_EQ(mesh.uvs[i].x, mesh.positions[i].x) << component;
      EXPECT_EQ(mesh.uvs[i].y, mesh.positions[i].y) << component;
    }
  };
  check(5126, bytes_of<float>({0, 0, 1, 0, 1, 1, 0, 1}), "");
  check(5121, bytes_of<uint8_t>({0, 0, 9, 9, 255, 0, 9, 9, 255, 255, 9, 9, 0, 255, 9, 9}),
        R"(,"normalized":true)", R"(,"byteStride":4)");
  check(5123, bytes_of<uint16_t>({0, 0, 65535, 0, 65535, 65535, 0, 65535}), R"(,"normalized":true)");
  // KHR_mesh_quantization: signed ones, and whole numbers.
  check(5120, bytes_of<int8_t>({0, 0, 9, 9, 127, 0, 9, 9, 127, 127, 9, 9, 0, 127, 9, 9}),
        R"(,"normalized":true)", R"(,"byteStride":4)");
  check(5122, bytes_of<int16_t>({0, 0, 32767, 0, 32767, 32767, 0, 32767}), R"(,"normalized":true)");
  check(5123, bytes_of<uint16_t>({0, 0, 1, 0, 1, 1, 0, 1}), "");
}

TEST_F(GltfTest, QuantisedPlaces) {
  const auto check = [&](int component, const std::string& bytes, const std::string& more, double side) {
    GltfFile file;
    const int position = file.accessor(bytes, component, 4, "VEC3", more,
                                       component < 5122 ? R"(,"byteStride":4)" : R"(,"byteStride":8)");
    file.primitives =
        fmt::format(R"({{"attributes":{{"POSITION":{}}},"indices":{}}})", position, file.square_corners());
    file.rest =
        R"(,"extensionsRequired":["KHR_mesh_quantization"],"extensionsUsed":["KHR_mesh_quantization"])";
    expect_box(read(file), {-side, 0, 0}, {side, side, 0});
  };
  check(5120, bytes_of<int8_t>({-127, 0, 0, 9, 127, 0, 0, 9, 127, 127, 0, 9, -128, 127, 0, 9}),
        R"(,"normalized":true)", 1);
  check(5120, bytes_of<int8_t>({-127, 0, 0, 9, 127, 0, 0, 9, 127, 127, 0, 9, -127, 127, 0, 9}), "", 127);
  check(5122, bytes_of<int16_t>({-32767, 0, 0, 9, 32767, 0, 0, 9, 32767, 32767, 0, 9, -32768, 32767, 0, 9}),
        R"(,"normalized":true)", 1);
  check(5122, bytes_of<int16_t>({-300, 0, 0, 9, 300, 0, 0, 9, 300, 300, 0, 9, -300, 300, 0, 9}), "", 300);
}

TEST_F(GltfTest, ColorsOfEachType) {
  for (const auto& [component, bytes, type, more] :
       {std::tuple(5126, bytes_of<float>({1, 0.5f, 0, 1, 1, 0.5f, 0, 1, 1, 0.5f, 0, 1, 1, 0.5f, 0, 1}),
                   "VEC4", ""),
        std::tuple(5121, unhex("ff8000fffe8000fffe8000fffe8000ff"), "VEC4", R"(,"normalized":true)"),
        std::tuple(5123, unhex("ffff00800000000000000000000000000000000000000000000000000000"), "VEC3",
                   R"(,"normalized":true)")}) {
    Square file;
    file.use(fmt::format(R"(,"COLOR_0":{})",
                         file.accessor(bytes, component, 4, type, more,
                                       type == std::string("VEC3") ? R"(,"byteStride":8)" : "")));
    const Mesh mesh = read(file);
    ASSERT_EQ(mesh.colors.size(), 4u);
    EXPECT_EQ(mesh.colors[0].r, 1);
    EXPECT_NEAR(mesh.colors[0].g, 0.5, 0.002);
    EXPECT_EQ(mesh.colors[0].b, 0);
    EXPECT_EQ(mesh.colors[0].a, 1);
  }
}

TEST_F(GltfTest, SparseAccessors) {
  GltfFile file;
  const int base = file.view(bytes_of<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}));
  const int indices = file.view(bytes_of<uint8_t>({2, 3})),
            values = file.view(bytes_of<float>({1, 5, 0, 0, 5, 0}));
  const std::string sparse = fmt::format(
      R"(,"sparse":{{"count":2,"indices":{{"bufferView":{},"componentType":5121}},"values":{{"bufferView":{}}}}})",
      indices, values);
  const int position = file.raw_accessor(
      fmt::format(R"("bufferView":{},"componentType":5126,"count":4,"type":"VEC3"{})", base, sparse));
  const int from_zeros = file.raw_accessor(R"("componentType":5126,"count":4,"type":"VEC3")" + sparse);
  const int corners = file.square_corners();
  const auto with = [&](int accessor) {
    file.primitives = fmt::format(R"({{"attributes":{{"POSITION":{}}},"indices":{}}})", accessor, corners);
    return read(file);
  };
  expect_box(with(position), {0, 0, 0}, {1, 5, 0});
  const Mesh zeros = with(from_zeros);
  EXPECT_EQ(zeros.triangles.size(), 1u);  // the other corners are one
  expect_box(zeros, {0, 0, 0}, {1, 5, 0});
}

TEST_F(GltfTest, StripsFansAndListsWithoutIndices) {
  for (const auto& [mode, corners, want] : {std::tuple(5, std::vector<uint8_t>{0, 1, 3, 2}, 2u),
                                            std::tuple(6, std::vector<uint8_t>{0, 1, 2, 3}, 2u),
                                            std::tuple(4, std::vector<uint8_t>{0, 1, 2}, 1u)}) {
    GltfFile file;
    const int position = file.square();
    file.primitives = fmt::format(R"({{"attributes":{{"POSITION":{}}},"indices":{},"mode":{}}})", position,
                                  file.numbers(corners, 5121, "SCALAR"), mode);
    const Mesh mesh = read(file);
    EXPECT_EQ(mesh.triangles.size(), want);
    EXPECT_EQ(area(mesh), want / 2.0) << mode;  // all turn the same way
  }
  GltfFile file;
  file.primitives = fmt::format(R"({{"attributes":{{"POSITION":{}}},"mode":6}})", file.square());
  EXPECT_EQ(area(read(file)), 1);
}

TEST_F(GltfTest, PointsAndLines) {
  GltfFile file;
  const int position = file.square();
  file.primitives = fmt::format(
      R"({{"attributes":{{"POSITION":{0}}},"mode":0}},{{"attributes":{{"POSITION":{0}}},"mode":1}})",
      position);
  const Mesh mesh = read(file);
  EXPECT_EQ(mesh.points.size(), 4u);
  EXPECT_TRUE(mesh.triangles.empty());
  EXPECT_TRUE(has_note(mesh, "lines"));
  file.primitives = fmt::format(R"({{"attributes":{{"POSITION":{}}},"mode":3}})", position);
  MeshReadingTest::expect_error("a.gltf", file.json(), "without triangles");
  // What is nowhere is dropped, and counted.
  GltfFile odd;
  odd.primitives = fmt::format(R"({{"attributes":{{"POSITION":{}}},"mode":0}})",
                               odd.numbers<float>({0, 0, 0, NAN, 1, 1, 2, 2, 2}, 5126, "VEC3"));
  const Mesh two = read(odd);
  EXPECT_EQ(two.points.size(), 2u);
  EXPECT_TRUE(has_note(two, "1 of 3 points"));
}

TEST_F(GltfTest, Instances) {
  Square file;
  const int shift = file.numbers<float>({0, 0, 0, 3, 0, 0, 0, 7, 0}, 5126, "VEC3");
  const int turn = file.numbers<int16_t>({0, 0, 0, 32767, 0, 0, 0, 32767, 0, 0, 23170, 23170}, 5122, "VEC4",
                                         R"(,"normalized":true)");
  const int scale = file.numbers<float>({1, 1, 1, 2, 2, 2, 1, 1, 1}, 5126, "VEC3");
  file.nodes = fmt::format(
      R"([{{"mesh":0,"translation":[0,0,5],"extensions":{{"EXT_mesh_gpu_instancing":{{"attributes":{{"TRANSLATION":{},"ROTATION":{},"SCALE":{}}}}}}}}}])",
      shift, turn, scale);
  file.rest = R"(,"extensionsRequired":["EXT_mesh_gpu_instancing"])";
  const Mesh mesh = read(file);
  EXPECT_EQ(mesh.triangles.size(), 6u);
  EXPECT_NEAR(area(mesh), 1 + 4 + 1, 1e-6);
  expect_box(mesh, {-1, 0, 5}, {5, 8, 5}, 1e-4);
  // As many of each.
  file.nodes = fmt::format(
      R"([{{"mesh":0,"extensions":{{"EXT_mesh_gpu_instancing":{{"attributes":{{"TRANSLATION":{},"SCALE":{}}}}}}}}}])",
      shift, file.numbers<float>({1, 1, 1}, 5126, "VEC3"));
  MeshReadingTest::expect_error("a.gltf", file.json(), "of its instances");
}

TEST_F(GltfTest, MorphWeights) {
  Square file;
  const int up = file.numbers<float>({0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 2, 0}, 5126, "VEC3");
  const int aside = file.numbers<float>({0, 0, 0, 4, 0, 0, 4, 0, 0, 0, 0, 0}, 5126, "VEC3");
  const int color = file.numbers<float>({0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, 5126, "VEC3");
  const int redder = file.numbers<float>({1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0}, 5126, "VEC3");
  file.use(
      fmt::format(R"(,"COLOR_0":{})", color),
      fmt::format(R"(,"targets":[{{"POSITION":{},"COLOR_0":{}}},{{"POSITION":{}}}])", up, redder, aside));
  const std::string primitive = file.primitives;
  file.meshes = fmt::format(R"([{{"primitives":[{}],"weights":[0.5]}}])", primitive);
  const Mesh half = read(file);
  expect_box(half, {0, 0, 0}, {1, 2, 0});
  EXPECT_EQ(half.colors[0], glm::vec4(0.5f, 0, 0, 1));
  // A node's own weights count.
  file.nodes = R"([{"mesh":0,"weights":[1,0.25]}])";
  expect_box(read(file), {0, 0, 0}, {2, 3, 0});
  file.meshes = fmt::format(R"([{{"primitives":[{}]}}])", primitive);
  file.nodes = R"([{"mesh":0}])";
  expect_box(read(file), {0, 0, 0}, {1, 1, 0});
}

TEST_F(GltfTest, SkinsAtRest) {
  Square file;
  // The lower corners follow joint 0, the upper ones joint 1, which is bound at y = 1 and now at y = 3, twice
  // as large.
  const int joints = file.numbers<uint8_t>({0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, 5121, "VEC4");
  const int weights =
      file.numbers<float>({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0.5f, 0.5f, 0, 0}, 5126, "VEC4");
  const int inverse = file.numbers<float>(
      {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1}, 5126,
      "MAT4");
  file.use(fmt::format(R"(,"JOINTS_0":{},"WEIGHTS_0":{})", joints, weights));
  file.rest = fmt::format(R"(,"skins":[{{"joints":[1,2],"inverseBindMatrices":{}}}])", inverse);
  // The place of the mesh's own node does not matter.
  file.nodes =
      R"([{"mesh":0,"skin":0,"translation":[100,0,0]},{"children":[2]},{"translation":[0,3,0],"scale":[2,2,2]}])";
  file.scenes = R"([{"nodes":[0,1]}])";
  const Mesh mesh = read(file);
  ASSERT_EQ(mesh.positions.size(), 4u);
  EXPECT_EQ(mesh.positions[0], glm::dvec3(0, 0, 0));
  EXPECT_EQ(mesh.positions[1], glm::dvec3(1, 0, 0));
  EXPECT_EQ(mesh.positions[2], glm::dvec3(2, 3, 0));
  EXPECT_EQ(mesh.positions[3], glm::dvec3(0, 2, 0));  // between (0, 3) and (0, 1)
}

TEST_F(GltfTest, RequiredExtensions) {
  Square file;
  for (const char* name :
       {"KHR_mesh_quantization", "KHR_texture_transform", "EXT_mesh_gpu_instancing", "EXT_texture_webp",
        "EXT_meshopt_compression", "KHR_draco_mesh_compression", "KHR_materials_unlit",
        "KHR_materials_emissive_strength", "KHR_materials_pbrSpecularGlossiness"}) {
    file.rest = fmt::format(R"(,"extensionsRequired":["{}"])", name);
    EXPECT_EQ(read(file).triangles.size(), 2u) << name;
  }
  for (const char* name : {"KHR_texture_basisu", "FOO_unknown"}) {
    file.rest = fmt::format(R"(,"extensionsRequired":["{}"])", name);
    MeshReadingTest::expect_error("a.gltf", file.json(), name);
    // Where they are only used it goes without them, and says so.
    file.rest = fmt::format(R"(,"extensionsUsed":["{}"])", name);
    EXPECT_TRUE(has_note(read(file), name));
  }
}

TEST_F(GltfTest, MaterialsAndWhatTheyEmit) {
  if (!reads_images()) GTEST_SKIP() << "no OpenImageIO";
  picture("a.png");
  Square file;
  file.use(fmt::format(R"(,"TEXCOORD_0":{0},"TEXCOORD_1":{1})",
                       file.numbers<float>({0, 0, 1, 0, 1, 1, 0, 1}, 5126, "VEC2"),
                       file.numbers<float>({5, 5, 6, 5, 6, 6, 5, 6}, 5126, "VEC2")));
  file.rest =
      R"(,"textures":[{"source":0,"sampler":0}],"samplers":[{"magFilter":9728,"minFilter":9728,"wrapS":33071}],"images":[{"uri":"a.png"}])";
  file.materials =
      R"({"pbrMetallicRoughness":{"baseColorFactor":[0,0,1,1]},"extensions":{"KHR_materials_pbrSpecularGlossiness":)"
      R"({"diffuseFactor":[1,0,0,0.5]},"KHR_materials_emissive_strength":{"emissiveStrength":4}},)"
      R"("emissiveFactor":[0,0.25,1],"emissiveTexture":{"index":0,"texCoord":1}})";
  const Mesh mesh = read(file);
  const MeshMaterial& material = mesh.materials[0];
  EXPECT_EQ(material.color, glm::vec4(1, 0, 0, 0.5f));
  EXPECT_EQ(material.emission, glm::vec3(0, 1, 4));
  ASSERT_EQ(material.emission_picture, 0);
  EXPECT_EQ(material.emission_filter, PictureFilter::nearest);
  EXPECT_EQ(material.emission_wrap_u, PictureWrap::clamp);
  EXPECT_EQ(mesh.uvs[0], glm::vec2(5, 5));

  // Both have pictures: each goes by its own coordinates.
  file.materials = R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0}},"emissiveFactor":[1,1,1],)"
                   R"("emissiveTexture":{"index":0,"texCoord":1}})";
  const Mesh both = read(file);
  EXPECT_EQ(both.pictures.size(), 1u);
  EXPECT_EQ(both.materials[0].filter, PictureFilter::nearest);
  EXPECT_EQ(both.uvs[2], glm::vec2(1, 1));
  ASSERT_EQ(both.emission_uvs.size(), 4u);
  EXPECT_EQ(both.emission_uvs[2], glm::vec2(6, 6));

  // A picture without coordinates is left out, with a word.
  file.use("");
  const Mesh plain = read(file);
  EXPECT_EQ(plain.materials[plain.triangles[0].material].picture, -1);
  EXPECT_TRUE(has_note(plain, "texture coordinates"));
}

TEST_F(GltfTest, ScenesAndVersions) {
  Square file;
  file.nodes = R"([{"mesh":0},{"mesh":0,"translation":[10,0,0]}])";
  file.scenes = R"([{"nodes":[0]},{"nodes":[1]}])";
  EXPECT_TRUE(has_note(read(file), "scene 0 of 2"));
  expect_box(read(file), {0, 0, 0}, {1, 1, 0});
  file.rest = R"(,"scene":1)";
  expect_box(read(file), {10, 0, 0}, {11, 1, 0});
  std::string old = Square().json();
  old.replace(old.find("2.0"), 3, "1.0");
  MeshReadingTest::expect_error("a.gltf", old, "glTF 1.0: expected 2.0");
  // Columns, and what is above.
  file.scenes = R"([{"nodes":[0]}])";
  file.rest = "";
  file.nodes = R"([{"scale":[2,2,2],"children":[1]},{"mesh":0,"matrix":[0,1,0,0,-1,0,0,0,0,0,1,0,7,8,9,1]}])";
  expect_box(read(file), {12, 16, 18}, {14, 18, 18});
}

TEST_F(GltfTest, Meshopt) {
  if (!load_module(module_folder(), {"meshopt", "", ""})) GTEST_SKIP() << "no meshoptimizer";
  // By meshoptimizer 0.18.
  const std::string attributes = meshopt_places;
  const std::string exponential =
      "a0000133000000403f00012000000000010c000000400001200000000000000120000000000000000000000000000000000000"
      "0000000000000000"
      "f2000000f2000000f2";
  const std::string triangles = "e1f000007687566778a9866589689801690000", indices = "d100040406080400000000";
  const auto packed = [](const std::string& hex, const std::string& mode, int stride, int count,
                         const std::string& filter, bool damage = false) {
    GltfFile file;
    std::string bytes = unhex(hex);
    if (damage) bytes[0] = 0;
    file.view(bytes);
    const std::string extension = fmt::format(
        R"(,"extensions":{{"EXT_meshopt_compression":{{"buffer":0,"byteOffset":0,"byteLength":{},"byteStride":{},"count":{},"mode":"{}","filter":"{}"}}}})",
        bytes.size(), stride, count, mode, filter);
    const std::string room(static_cast<size_t>(stride * count), '\0');
    const bool places = mode == "ATTRIBUTES";
    const int position = places ? file.accessor(room, 5126, 4, "VEC3", "", extension) : file.square();
    const int corners = places ? file.square_corners()
                               : file.accessor(room, stride == 2 ? 5123 : 5125, 6, "SCALAR", "", extension);
    file.primitives = fmt::format(R"({{"attributes":{{"POSITION":{}}},"indices":{}}})", position, corners);
    file.rest = R"(,"extensionsRequired":["EXT_meshopt_compression"])";
    return file;
  };
  for (const GltfFile& file :
       {packed(attributes, "ATTRIBUTES", 12, 4, "NONE"),
        packed(exponential, "ATTRIBUTES", 12, 4, "EXPONENTIAL"), packed(triangles, "TRIANGLES", 2, 6, "NONE"),
        packed(triangles, "TRIANGLES", 4, 6, "NONE"), packed(indices, "INDICES", 4, 6, "NONE")}) {
    const Mesh mesh = read(file);
    EXPECT_EQ(area(mesh), 1);
    expect_box(mesh, {0, 0, 0}, {1, 1, 0});
  }
  MeshReadingTest::expect_error("a.gltf", packed(attributes, "ATTRIBUTES", 12, 4, "NONE", true).json(),
                                "packed bytes are damaged");
  MeshReadingTest::expect_error("a.gltf", packed(attributes, "OTHER", 12, 4, "NONE").json(),
                                "expected the mode");
}

TEST_F(GltfTest, Draco) {
  if (!load_module(module_folder(), {"draco", "", ""})) GTEST_SKIP() << "no libdraco";
  for (const char* const hex : {draco_sequential, draco_edgebreaker}) {
    GltfFile file;
    const int view = file.view(unhex(hex));
    const auto square = [&](int points, int corners) {
      file.primitives = fmt::format(
          R"({{"attributes":{{"POSITION":{},"COLOR_0":{}}},"indices":{},"extensions":{{"KHR_draco_mesh_compression":{{"bufferView":{},"attributes":{{"POSITION":0,"COLOR_0":1}}}}}}}})",
          file.raw_accessor(fmt::format(R"("componentType":5126,"count":{},"type":"VEC3")", points)),
          file.raw_accessor(
              fmt::format(R"("componentType":5121,"count":{},"type":"VEC3","normalized":true)", points)),
          file.raw_accessor(fmt::format(R"("componentType":5123,"count":{},"type":"SCALAR")", corners)),
          view);
      file.rest = R"(,"extensionsRequired":["KHR_draco_mesh_compression"])";
      return file.json();
    };
    const Mesh mesh = MeshReadingTest::read("a.gltf", square(4, 6));
    EXPECT_NEAR(std::abs(area(mesh)), 1, 0.01);
    expect_box(mesh, {0, 0, 0}, {1, 1, 0}, 0.01);
    ASSERT_EQ(mesh.colors.size(), 4u);
    for (size_t i = 0; i < 4; ++i) {
      const bool right = mesh.positions[i].x > 0.5, up = mesh.positions[i].y > 0.5;
      EXPECT_EQ(mesh.colors[i],
                glm::vec4(right == up && !(right && up) ? 1 : !right, right ? !up : up, up, 1))
          << i;
    }
    MeshReadingTest::expect_error("a.gltf", square(4, 60), "2 triangles: its accessor has 20");
    MeshReadingTest::expect_error("a.gltf", square(5, 6), "4 points");
  }
}

TEST_F(GltfTest, WebP) {
  if (!load_module(module_folder(), {"webp", "", ""})) GTEST_SKIP() << "no libwebp";
  const std::string webp = unhex(
      "524946462a000000574542505650384c1d0000002f014000101fb0ff028222ff479b7f0141d175cb453625611722fa1f0200");
  Square file;
  file.use(fmt::format(R"(,"TEXCOORD_0":{})", file.numbers<float>({0, 0, 1, 0, 1, 1, 0, 1}, 5126, "VEC2")));
  file.materials = R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}})";
  file.rest = fmt::format(
      R"(,"textures":[{{"extensions":{{"EXT_texture_webp":{{"source":0}}}}}}],"images":[{{"bufferView":{},"mimeType":"image/webp"}}])",
      file.view(webp));
  const Mesh mesh = read(file);
  ASSERT_EQ(mesh.pictures.size(), 1u);
  EXPECT_EQ(texel(mesh, 0, 1, 0), (std::array<int, 4>{0, 255, 0, 255}));
  EXPECT_EQ(texel(mesh, 0, 0, 1), (std::array<int, 4>{0, 0, 255, 128}));
  // As a file of its own, and of an .obj.
  put("a.webp", webp);
  put("m.mtl", "newmtl a\nmap_Kd a.webp\n");
  EXPECT_EQ(MeshReadingTest::read("a.obj", obj_square("mtllib m.mtl\nusemtl a\n")).pictures[0].width, 2);
  // Damaged, and a KTX2 file.
  put("a.webp", webp.substr(0, 30));
  MeshReadingTest::expect_error("a.obj", obj_square("mtllib m.mtl\nusemtl a\n"), "WebP");
  const int ktx = file.view(std::string("\xabKTX 20\xbb\r\n\x1a\n", 12));
  file.rest = fmt::format(R"(,"textures":[{{"source":0}}],"images":[{{"bufferView":{}}}])", ktx);
  MeshReadingTest::expect_error("a.gltf", file.json(), "KTX2");
}

TEST_F(GltfTest, BadNumbers) {
  Square file;
  file.use(R"(,"COLOR_0":0)");
  EXPECT_EQ(read(file).colors.size(), 4u);  // places as colours, of the same type
  file.use(R"(,"COLOR_0":1)");
  MeshReadingTest::expect_error("a.gltf", file.json(), "COLOR_0");
  file.use("", R"(,"targets":[{"POSITION":1}])");
  file.nodes = R"([{"mesh":0,"weights":[1]}])";
  MeshReadingTest::expect_error("a.gltf", file.json(), "a target's POSITION");
  file.nodes = R"([{"mesh":0}])";
  file.primitives = R"({"attributes":{"POSITION":0},"indices":0})";
  MeshReadingTest::expect_error("a.gltf", file.json(), "unsigned whole numbers");
  file.primitives = R"({"attributes":{"POSITION":9}})";
  MeshReadingTest::expect_error("a.gltf", file.json(), "expected the number of an accessor");
  GltfFile far;
  far.primitives = fmt::format(R"({{"attributes":{{"POSITION":{}}},"indices":{}}})", far.square(),
                               far.numbers<uint8_t>({0, 1, 4}, 5121, "SCALAR"));
  MeshReadingTest::expect_error("a.gltf", far.json(), "vertex 4: expected one below 4");
  // A bomb of instances.
  Square many;
  many.nodes = fmt::format(
      R"([{{"mesh":0,"extensions":{{"EXT_mesh_gpu_instancing":{{"attributes":{{"TRANSLATION":{}}}}}}}}}])",
      many.raw_accessor(R"("componentType":5126,"count":1000000,"type":"VEC3")"));
  MemoryBudget small(64 << 20);
  ctx_.memory = &small;
  MeshReadingTest::expect_error("a.gltf", many.json(), "--max-memory", ErrorCode::limit);
  ctx_.memory = &memory_;
}

}  // namespace
}  // namespace voxkit
