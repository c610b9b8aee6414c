// Meshes and their pictures as they are read.
#include "formats/mesh/mesh.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <set>

#include "formats/mesh/mesh_parts.h"
#include "tests/formats/mesh_file_test.h"

namespace voxkit {
namespace {

class MeshFileTest : public MeshReadingTest {
 protected:
  void SetUp() override {
    MeshReadingTest::SetUp();
    if (!reads_images()) GTEST_SKIP() << "no OpenImageIO";
  }
  static void expect_square(const Mesh& mesh) {
    ASSERT_EQ(mesh.triangles.size(), 2u);
    ASSERT_EQ(mesh.uvs.size(), mesh.positions.size());
    double area = 0;
    for (const MeshTriangle& triangle : mesh.triangles) {
      const auto& [a, b, c] = triangle.vertices;
      const glm::dvec3 u = mesh.positions[b] - mesh.positions[a], v = mesh.positions[c] - mesh.positions[a];
      area += u.x * v.y - u.y * v.x;
      // Wherever it comes from: the bottom of the picture is where y is 0.
      for (const uint32_t vertex : triangle.vertices) {
        EXPECT_EQ(mesh.uvs[vertex].x, mesh.positions[vertex].x);
        EXPECT_EQ(mesh.uvs[vertex].y, 1 - mesh.positions[vertex].y);
      }
    }
    EXPECT_EQ(area, 2);
  }
};

TEST_F(MeshFileTest, Obj) {
  picture("wall.png");
  put("m.mtl",
      "newmtl wall\nKd 0.5 1 0.25\nmap_Kd wall.png\nnewmtl glass\nKd 1 1 1\nd 0.25\nnewmtl unused\nmap_Kd "
      "none.png\n");
  const Mesh mesh =
      read("a.obj", obj_square("mtllib m.mtl\nusemtl wall\n") + "usemtl glass\nf 1/1 2/2 3/3\n");
  ASSERT_EQ(mesh.triangles.size(), 3u);
  std::set<std::string> names;
  for (const MeshTriangle& triangle : mesh.triangles) {
    const MeshMaterial& material = mesh.materials[triangle.material];
    names.insert(material.name);
    if (material.name == "wall") {
      // sRGB becomes light.
      EXPECT_NEAR(material.color.r, 0.21404, 1e-4);
      EXPECT_EQ(material.color.g, 1);
      EXPECT_EQ(material.alpha_mode, AlphaMode::opaque);
      ASSERT_EQ(material.picture, 0);
    } else {
      EXPECT_EQ(material.color.a, 0.25f);
      EXPECT_EQ(material.alpha_mode, AlphaMode::blend);
      EXPECT_EQ(material.picture, -1);
    }
  }
  EXPECT_EQ(names, (std::set<std::string>{"wall", "glass"}));
  ASSERT_EQ(mesh.pictures.size(), 1u);
  EXPECT_EQ(texel(mesh, 0, 0, 0), (std::array<int, 4>{255, 0, 0, 255}));
  EXPECT_EQ(texel(mesh, 0, 0, 1), (std::array<int, 4>{0, 0, 255, 255}));
  EXPECT_FALSE(mesh.pictures[0].has_alpha);
}

TEST_F(MeshFileTest, TheSameSquareOfEachFormat) {
  expect_square(read("a.obj", obj_square()));
  picture("a.png");
  GltfSquare file;  // coordinates are read where there is a picture
  file.material = R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}})";
  file.rest = R"(,"textures":[{"source":0}],"images":[{"uri":"a.png"}])";
  expect_square(read("a.gltf", file.gltf()));
  expect_square(read("a.glb", file.glb()));
}

TEST_F(MeshFileTest, PlyColorsAreStoredValues) {
  for (const bool binary : {false, true}) {
    const Mesh mesh = read("a.ply", ply_triangle(binary));
    ASSERT_EQ(mesh.triangles.size(), 1u);
    ASSERT_EQ(mesh.colors.size(), 3u);
    EXPECT_EQ(mesh.colors[0], glm::vec4(1, 0, 0, 1));
    EXPECT_NEAR(mesh.colors[1].g, 0.5, 0.01);
    EXPECT_NEAR(mesh.colors[2].b, 0.2159, 1e-3);
    EXPECT_EQ(mesh.materials[mesh.triangles[0].material].color, glm::vec4(1));
  }
}

TEST_F(MeshFileTest, NodesPutMeshesInTheirPlaces) {
  GltfSquare file;
  // Twice, and turned by 90 degrees about z under a node that moves and stretches.
  file.nodes = R"([{"mesh":0,"translation":[10,0,0]},{"children":[2],"translation":[0,0,5],"scale":[2,2,2]},)"
               R"({"mesh":0,"rotation":[0,0,0.70710678118,0.70710678118]}])";
  file.scene = "[0,1]";
  const Mesh mesh = read("a.gltf", file.gltf());
  ASSERT_EQ(mesh.triangles.size(), 4u);
  glm::dvec3 lo[2] = {glm::dvec3(1e9), glm::dvec3(1e9)}, hi[2] = {glm::dvec3(-1e9), glm::dvec3(-1e9)};
  for (size_t i = 0; i < 4; ++i)
    for (const uint32_t v : mesh.triangles[i].vertices)
      for (int c = 0; c < 3; ++c) {
        lo[i / 2][c] = std::min(lo[i / 2][c], mesh.positions[v][c]);
        hi[i / 2][c] = std::max(hi[i / 2][c], mesh.positions[v][c]);
      }
  const glm::dvec3 want[2][2] = {{{10, 0, 0}, {11, 1, 0}}, {{-2, 0, 5}, {0, 2, 5}}};
  for (int i = 0; i < 2; ++i)
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(lo[i][c], want[i][0][c], 1e-6) << i << c;
      EXPECT_NEAR(hi[i][c], want[i][1][c], 1e-6) << i << c;
    }
}

TEST_F(MeshFileTest, GltfMaterials) {
  picture("a b.png", {255, 255, 10, 255});
  GltfSquare file;
  file.material =
      R"({"pbrMetallicRoughness":{"baseColorFactor":[0.5,0.25,1,0.75],"baseColorTexture":{"index":0}},)"
      R"("alphaMode":"MASK","alphaCutoff":0.3})";
  file.rest = R"(,"textures":[{"source":0,"sampler":0}],"images":[{"uri":"a%20b.png"}],)"
              R"("samplers":[{"wrapS":33648,"wrapT":33071}])";
  const Mesh mesh = read("a.gltf", file.gltf());
  const MeshMaterial& material = mesh.materials[mesh.triangles[0].material];
  EXPECT_EQ(material.color, glm::vec4(0.5f, 0.25f, 1, 0.75f));  // light, as it is
  EXPECT_EQ(material.alpha_mode, AlphaMode::mask);
  EXPECT_EQ(material.alpha_cutoff, 0.3f);
  EXPECT_EQ(material.wrap_u, PictureWrap::mirror);
  EXPECT_EQ(material.wrap_v, PictureWrap::clamp);
  ASSERT_EQ(material.picture, 0);
  EXPECT_TRUE(mesh.pictures[0].has_alpha);
  EXPECT_EQ(texel(mesh, 0, 0, 1), (std::array<int, 4>{0, 0, 255, 10}));

  file.material = R"({"alphaMode":"BLEND"})";
  EXPECT_EQ(read("b.gltf", file.gltf()).materials[0].alpha_mode, AlphaMode::blend);
  file.material = "{}";
  EXPECT_EQ(read("b.gltf", file.gltf()).materials[0].alpha_mode, AlphaMode::opaque);
}

TEST_F(MeshFileTest, TransformsOfGltfPictures) {
  picture("a.png");
  GltfSquare file;
  file.rest = R"(,"textures":[{"source":0}],"images":[{"uri":"a.png"}])";
  file.material =
      R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":)"
      R"({"offset":[0.25,0.5],"scale":[2,3],"rotation":1.5707963267948966}}}}})";
  const Mesh mesh = read("a.gltf", file.gltf());
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    // Stretched, turned by a quarter, moved.
    const double u = 2 * mesh.positions[i].x, v = 3 * (1 - mesh.positions[i].y);
    EXPECT_NEAR(mesh.uvs[i].x, v + 0.25, 1e-6);
    EXPECT_NEAR(mesh.uvs[i].y, -u + 0.5, 1e-6);
  }
}

TEST_F(MeshFileTest, HostileGltf) {
  GltfSquare file;
  const std::string glb = file.glb(), gltf = file.gltf();
  const auto change = [](std::string text, const std::string& from, const std::string& to) {
    const size_t at = text.find(from);
    EXPECT_NE(at, text.npos) << from;
    return text.replace(at, from.size(), to);
  };
  std::string longer = glb;
  longer[15] = 0x74;  // 1.9 GB of text
  expect_error("a.glb", longer, "chunk at byte 12");
  expect_error("a.glb", glb.substr(0, glb.size() - 4), "expected " + std::to_string(glb.size()));
  expect_error("a.glb", gltf, "not a GLB file");
  expect_error("a.gltf", gltf.substr(0, gltf.size() / 2), "not JSON");
  expect_error("a.gltf", "[]", "expected an object");
  expect_error("a.gltf", change(gltf, R"("count":4)", R"("count":400000000)"),
               "accessor 0: it leads past the end");
  expect_error("a.gltf", change(gltf, R"("count":4)", R"("count":-4)"), "accessor 0: expected count");
  expect_error("a.gltf", change(gltf, R"("bufferView":0)", R"("bufferView":9)"),
               "expected the number of a buffer view");
  expect_error("a.gltf", change(gltf, R"("byteOffset":48)", R"("byteOffset":480)"),
               "past the end of its buffer");
  // Zeros, where it says so: no more of them than memory.
  const std::string zeros =
      change(change(gltf, R"({"bufferView":0,)", "{"), R"("count":4)", R"("count":4000000000)");
  expect_error("a.gltf", zeros, "--max-memory", ErrorCode::limit);
  file.nodes = R"([{"mesh":0,"children":[1]},{"children":[0]}])";
  expect_error("a.gltf", file.gltf(), "it is its own parent");
  file.nodes = R"([{"mesh":0,"children":[0]}])";
  expect_error("a.gltf", file.gltf(), "it is its own parent");
  file.nodes = R"([{"mesh":0,"children":[1,1]},{}])";
  expect_error("a.gltf", file.gltf(), "no other node has");
}

TEST_F(MeshFileTest, EveryShorterFileAndManyOthers) {
  GltfSquare file;
  const std::pair<const char*, std::string> files[] = {{"a.glb", file.glb()},
                                                       {"a.gltf", file.gltf()},
                                                       {"a.obj", obj_square("usemtl x\n")},
                                                       {"a.ply", ply_triangle(true)},
                                                       {"b.ply", ply_triangle(false)}};
  const auto is_sound = [&](const std::string& name) {
    const auto mesh = read_mesh(path(name), ctx_);
    if (mesh) return true;
    EXPECT_EQ(mesh.error().what.find('\n'), std::string::npos);
    return mesh.error().code == ErrorCode::input || mesh.error().code == ErrorCode::limit;
  };
  for (const auto& [name, valid] : files) {
    for (size_t length = 0; length < valid.size(); ++length) {
      put(name, valid.substr(0, length));
      ASSERT_TRUE(is_sound(name)) << name << " cut to " << length;
    }
    for (int i = 0; i < 1000; ++i) {
      std::string changed = valid;
      for (auto n = 1 + random_() % 3; n > 0; --n)
        changed[random_() % changed.size()] = static_cast<char>(random_());
      put(name, changed);
      ASSERT_TRUE(is_sound(name)) << name << " " << changed;
    }
  }
}

TEST_F(MeshFileTest, EmbeddedPictures) {
  const std::string png = picture("a.png");
  std::filesystem::remove(path("a.png"));
  GltfSquare file;
  file.material = R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}})";
  file.extra = png;
  file.views = fmt::format(R"(,{{"buffer":0,"byteOffset":92,"byteLength":{}}})", png.size());
  file.rest = R"(,"textures":[{"source":0}],"images":[{"bufferView":3,"mimeType":"image/png"}])";
  const Mesh glb = read("a.glb", file.glb());
  ASSERT_EQ(glb.pictures.size(), 1u);
  EXPECT_EQ(texel(glb, 0, 1, 0), (std::array<int, 4>{0, 255, 0, 255}));

  file.rest = R"(,"textures":[{"source":0}],"images":[{"uri":"data:image/png;base64,)" + base64(png) + "\"}]";
  const Mesh gltf = read("a.gltf", file.gltf());
  ASSERT_EQ(gltf.pictures.size(), 1u);
  EXPECT_EQ(texel(gltf, 0, 0, 1), (std::array<int, 4>{0, 0, 255, 255}));
}

TEST_F(MeshFileTest, VertexColorsOfGltfAreLight) {
  GltfSquare file;
  file.attributes = R"(,"COLOR_0":3)";
  file.accessors = R"(,{"bufferView":3,"componentType":5126,"count":4,"type":"VEC3"})";
  file.extra = bytes_of(std::vector<float>{0.5f, 0, 0, 0, 0.5f, 0, 0, 0, 0.5f, 2, -1, NAN});
  file.views = R"(,{"buffer":0,"byteOffset":92,"byteLength":48})";
  const Mesh mesh = read("a.glb", file.glb());
  ASSERT_EQ(mesh.colors.size(), mesh.positions.size());
  for (const MeshTriangle& triangle : mesh.triangles)
    for (const uint32_t v : triangle.vertices) {
      const glm::dvec3 p = mesh.positions[v];
      // What is out of range is brought into it.
      const glm::vec4 want = p.y == 0   ? p.x == 0 ? glm::vec4(0.5f, 0, 0, 1) : glm::vec4(0, 0.5f, 0, 1)
                               : p.x == 1 ? glm::vec4(0, 0, 0.5f, 1)
                                        : glm::vec4(1, 0, 0, 1);
      EXPECT_EQ(mesh.colors[v], want);
    }
}

TEST_F(MeshFileTest, OpacityOfObj) {
  picture("color.png");
  picture("cut.png", {255, 0, 100, 255});
  // By the picture's own alpha, by the alpha of a map, and by a map's brightness, which is stretched.
  put("m.mtl",
      "newmtl a\nmap_Kd cut.png\nnewmtl b\nmap_Kd color.png\nmap_d cut.png\nnewmtl c\nmap_d color.png\n");
  const Mesh mesh = read(
      "a.obj", obj_square("mtllib m.mtl\nusemtl a\n") + "usemtl b\nf 1/1 2/2 3/3\nusemtl c\nf 1/1 2/2 3/3\n");
  ASSERT_EQ(mesh.pictures.size(), 3u);
  for (const MeshMaterial& material : mesh.materials) {
    if (material.picture < 0) continue;
    EXPECT_EQ(material.alpha_mode, AlphaMode::mask);
    const auto alpha = texel(mesh, static_cast<size_t>(material.picture), 0, 1)[3];
    EXPECT_EQ(alpha, material.name == "c" ? 29 : 100) << material.name;  // blue's part of the brightness
  }
}

TEST_F(MeshFileTest, NamesOfPictures) {
  std::filesystem::create_directories(path("Maps/deep"));
  picture("Maps/deep/Wall.PNG");
  picture("beside.png");
  for (const char* name :
       {"Maps/deep/Wall.PNG", "Maps\\deep\\Wall.PNG", "maps\\DEEP\\wall.png", ".\\Maps\\deep\\wall.png",
        "C:\\work\\old\\Beside.png", "/nowhere/beside.png", "Maps/../beside.png"}) {
    put("m.mtl", fmt::format("newmtl a\nmap_Kd {}\n", name));
    const Mesh mesh = read("a.obj", obj_square("mtllib m.mtl\nusemtl a\n"));
    EXPECT_EQ(mesh.pictures.size(), 1u) << name;
  }
}

TEST_F(MeshFileTest, PicturesOfOtherFormats) {
  // TGA: 2 x 2 texels of blue, green and red, from the top.
  std::string tga(18, '\0');
  tga[2] = 2, tga[12] = 2, tga[14] = 2, tga[16] = 24, tga[17] = 0x20;
  put("a.tga", tga + std::string("\x01\x02\x03\x04\x05\x06\x07\x08\x09\x0a\x0b\x0c", 12));
  // 16 bits are rounded to 8, floats are light.
  auto fine = Image::create(1, 1, 1, SampleType::u16, ctx_),
       light = Image::create(1, 1, 3, SampleType::f32, ctx_);
  fine->row(0)[0] = 1000;
  light->row(0)[0] = 0.5f, light->row(0)[1] = 2, light->row(0)[2] = NAN;
  ASSERT_TRUE(write_image(path("a.png"), *fine, false));
  ASSERT_TRUE(write_image(path("a.exr"), *light, false));
  put("m.mtl", "newmtl a\nmap_Kd a.tga\nnewmtl b\nmap_Kd a.png\nnewmtl c\nmap_Kd a.exr\n");
  const Mesh mesh = read(
      "a.obj", obj_square("mtllib m.mtl\nusemtl a\n") + "usemtl b\nf 1/1 2/2 3/3\nusemtl c\nf 1/1 2/2 3/3\n");
  ASSERT_EQ(mesh.pictures.size(), 3u);
  for (const MeshMaterial& material : mesh.materials) {
    if (material.picture < 0) continue;
    const auto have = texel(mesh, static_cast<size_t>(material.picture), 0, 0);
    const std::array<int, 4> want = material.name == "a"   ? std::array{3, 2, 1, 255}
                                    : material.name == "b" ? std::array{4, 4, 4, 255}
                                                           : std::array{188, 255, 0, 255};
    EXPECT_EQ(have, want) << material.name;
  }
}

TEST_F(MeshFileTest, WhatIsMissingIsNamed) {
  put("m.mtl", "newmtl stone wall\nmap_Kd textures/brick.png\n");
  expect_error("a.obj", obj_square("mtllib m.mtl\nusemtl stone wall\n"), "textures/brick.png is missing");
  expect_error("a.obj", obj_square("mtllib lost.mtl\nusemtl a\n"), "lost.mtl is missing");
  GltfSquare file;
  expect_error("a.gltf", file.json("lost.bin"), "lost.bin is missing");
  expect_error("a.xyz", "", "expected .obj, .gltf, .glb, .ply, .stl or .3ds");
  const auto none = read_mesh(path("none.obj"), ctx_);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::input);
}

TEST_F(MeshFileTest, BrokenPictures) {
  const std::string png = picture("a.png");
  put("m.mtl", "newmtl a\nmap_Kd a.png\n");
  const std::string obj = obj_square("mtllib m.mtl\nusemtl a\n");
  put("a.png", png.substr(0, png.size() / 2));
  expect_error("a.obj", obj, "PNG");
  put("a.png", "not a picture");
  expect_error("a.obj", obj, "not a PNG file");
  put("m.mtl", "newmtl a\nmap_Kd a.txt\n");
  put("a.txt", "text");
  expect_error("a.obj", obj, "not an image");

  GltfSquare file;
  file.material = R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}})";
  file.extra = "GIF89a......";
  file.views = R"(,{"buffer":0,"byteOffset":92,"byteLength":12})";
  file.rest = R"(,"textures":[{"source":0}],"images":[{"bufferView":3,"mimeType":"image/png"}])";
  expect_error("a.glb", file.glb(), "expected PNG or JPEG");
}

TEST_F(MeshFileTest, LargePicturesAreRefusedBeforeTheyAreDecoded) {
  // Only their heads are there: 2^16 x 2^13 texels, and a side that is too long.
  put("m.mtl", "newmtl a\nmap_Kd a.png\n");
  const std::string obj = obj_square("mtllib m.mtl\nusemtl a\n");
  const std::string png = std::string("\x89PNG\r\n\x1a\n\0\0\0\rIHDR", 16);
  put("a.png", png + std::string("\0\1\0\0\0\0\x20\0\x08\2\0\0\0", 13));
  expect_error("a.obj", obj,
               "a texture of 65536 x 8192 texels: expected 1 to 65536 a side and 268435456 in all");
  put("a.png", png + std::string("\0\1\0\1\0\0\0\1\x08\2\0\0\0", 13));
  expect_error("a.obj", obj, "a texture of 65537 x 1 texels");
  put("m.mtl", "newmtl a\nmap_Kd a.jpg\n");
  put("a.jpg", std::string("\xff\xd8\xff\xe0\0\4ab\xff\xc2\0\x11\x08\xff\xff\xff\xfe\3", 18));
  expect_error("a.obj", obj, "a texture of 65534 x 65535 texels");
}

TEST_F(MeshFileTest, OnlyRegularFilesAreOpened) {
  ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
  put("m.mtl", "newmtl a\nmap_Kd pipe\n");
  expect_error("a.obj", obj_square("mtllib m.mtl\nusemtl a\n"),
               "material a: its texture \"pipe\": is not a regular file");
  expect_error("a.obj", obj_square("mtllib pipe\n"), "material library \"pipe\": is not a regular file");
  expect_error("a.gltf", GltfSquare{}.json("pipe"), "buffer \"pipe\": is not a regular file");
  put("m.mtl", "newmtl a\nmap_Kd /dev/zero\n");
  expect_error("a.obj", obj_square("mtllib m.mtl\nusemtl a\n"),
               "\"/dev/zero\": lies outside of the mesh's folder: expected --allow-outside");
  const auto zero = read_mesh(path("a.obj"), ctx_, {.allow_outside = true});
  ASSERT_FALSE(zero);
  EXPECT_NE(zero.error().what.find("\"/dev/zero\": is not a regular file"), std::string::npos)
      << zero.error().what;
  expect_error("a.gltf", GltfSquare{}.json("https://example.org/a.bin"), "a.bin is missing");
}

TEST_F(MeshFileTest, FilesOutsideOfTheFolderNeedLeave) {
  std::filesystem::create_directories(path("sub/x"));
  picture("wall.png");
  put("m.mtl", "newmtl a\nKd 1 0 0\n");
  const GltfSquare square;
  put("b.bin", square.buffer());
  GltfSquare textured;
  textured.material = R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}})";
  const auto image = [&](const std::string& uri) {
    textured.rest = R"(,"textures":[{"source":0}],"images":[{"uri":")" + uri + "\"}]";
    return textured.gltf();
  };
  put("sub/up.mtl", "newmtl a\nmap_Kd ../wall.png\n");
  const std::pair<const char*, std::string> meshes[] = {
      {"sub/a.obj", obj_square("mtllib ../m.mtl\nusemtl a\n")},
      {"sub/a.obj", obj_square("mtllib ..\\m.mtl\nusemtl a\n")},
      {"sub/a.obj", obj_square("mtllib up.mtl\nusemtl a\n")},
      {"sub/a.gltf", square.json("../b.bin")},
      {"sub/a.gltf", square.json("x/../../b.bin")},
      {"sub/a.gltf", square.json(path("b.bin"))},
      {"sub/a.gltf", square.json("%2e%2e/b.bin")},
      {"sub/a.gltf", image("../wall.png")}};
  const MeshOptions leave{.allow_outside = true};
  for (const auto& [name, content] : meshes) {
    SCOPED_TRACE(content);
    expect_error(name, content, "lies outside of the mesh's folder: expected --allow-outside");
    const auto mesh = read_mesh(path(name), ctx_, leave);
    ASSERT_TRUE(mesh) << mesh.error().what;
    EXPECT_EQ(mesh->triangles.size(), 2u);
    EXPECT_TRUE(mesh->notes.empty()) << mesh->notes[0];
  }
  // Beside the mesh there is one of that name: taken, and said. Where there is leave, the other one counts.
  picture("sub/wall.png", {255, 0, 100, 255});
  const std::string& there = meshes[2].second;
  const Mesh beside = read("sub/a.obj", there);
  EXPECT_TRUE(has_note(beside, "not where the mesh names it, and taken from beside the mesh: ../wall.png"));
  EXPECT_TRUE(beside.pictures[0].has_alpha);
  EXPECT_FALSE(read_mesh(path("sub/a.obj"), ctx_, leave)->pictures[0].has_alpha);
  // What stays in the folder needs no leave, however it is written.
  put("sub/m.mtl", "newmtl a\nmap_Kd x/../wall.png\n");
  EXPECT_TRUE(read("sub/a.obj", obj_square("mtllib " + path("sub/m.mtl") + "\nusemtl a\n")).notes.size() ==
              1);
}

TEST_F(MeshFileTest, TexturesAreBesideTheLibraryThatNamesThem) {
  std::filesystem::create_directories(path("sub/materials/pictures"));
  picture("sub/materials/pictures/wall.png", {0, 1, 1, 1});
  const std::string obj = obj_square("mtllib materials/m.mtl\nusemtl a\n");
  const auto alpha_of = [&](const Mesh& mesh) {
    EXPECT_FALSE(has_note(mesh, "taken from beside"));
    return mesh.pictures[0].has_alpha;
  };
  for (const char* name : {"pictures/wall.png", "../materials/pictures/wall.png", "./Pictures/WALL.png"}) {
    put("sub/materials/m.mtl", fmt::format("newmtl a\nmap_Kd {}\n", name));
    EXPECT_TRUE(alpha_of(read("sub/a.obj", obj))) << name;
  }
  // Names that are meant from the mesh on, as some write them; the library's folder comes first.
  picture("sub/tile.png");
  put("sub/materials/m.mtl", "newmtl a\nmap_Kd tile.png\n");
  EXPECT_FALSE(alpha_of(read("sub/a.obj", obj)));
  picture("sub/materials/tile.png", {0, 1, 1, 1});
  EXPECT_TRUE(alpha_of(read("sub/a.obj", obj)));
  // Out of the mesh's folder it is no more allowed than ever.
  picture("out.png");
  put("sub/materials/m.mtl", "newmtl a\nmap_Kd ../../out.png\n");
  expect_error("sub/a.obj", obj, "lies outside of the mesh's folder: expected --allow-outside");
}

TEST_F(MeshFileTest, NumbersThatAreNone) {
  for (const char* bad : {"nan", "inf", "-inf", "1e39"}) {
    expect_error("a.obj", fmt::format("v 0 0 0\nv 1 0 {}\nv 0 1 0\nf 1 2 3\n", bad),
                 "expected finite coordinates");
  }
  // Where no triangle is, they do not matter.
  EXPECT_EQ(read("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nf 1 2 3\n").triangles.size(), 1u);
  // Far away is not an error.
  EXPECT_EQ(read("a.obj", "v 3e38 0 0\nv -3e38 0 0\nv 0 1 0\nf 1 2 3\n").triangles.size(), 1u);
}

TEST_F(MeshFileTest, TrianglesWithoutAreaAreDropped) {
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\n";
  EXPECT_EQ(read("a.obj", vertices + "f 1 2 3\nf 1 2 4\nf 1 1 2\nf 2 2 2\np 1\nl 1 2\n").triangles.size(),
            1u);
  expect_error("a.obj", vertices + "f 1 2 4\n", "without triangles that have an area");
  expect_error("a.obj", "# nothing\n", "a mesh without triangles");
  expect_error("a.obj", vertices + "f 1 2 9\n", "out of range");
}

TEST_F(MeshFileTest, LimitOfMemory) {
  std::string obj;
  for (int i = 0; i < 3000; ++i) obj += fmt::format("v {} 0 0\nv {} 1 0\nv {} 0 1\nf -1 -2 -3\n", i, i, i);
  const MemoryBudget& before = memory_;
  EXPECT_EQ(read("a.obj", obj).triangles.size(), 3000u);
  MemoryBudget small(200 << 10);
  ctx_.memory = &small;
  expect_error("a.obj", obj, "--max-memory", ErrorCode::limit);
  ctx_.memory = &memory_;
  EXPECT_TRUE(memory_.reserve(before.limit(), "all of it")) << "something was not given back";
}

TEST_F(MeshFileTest, ChecksOfMeshes) {
  Mesh mesh;
  mesh.materials.resize(1);
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.triangles = {{{0, 1, 2}, 0}};
  EXPECT_TRUE(check_mesh(mesh, "x"));
  mesh.triangles = {{{0, 1, 3}, 0}};
  EXPECT_EQ(check_mesh(mesh, "x").error().what, "corrupt mesh: triangle 0: vertex 3: expected one below 3");
  mesh.triangles = {{{0, 1, 2}, 1}};
  EXPECT_EQ(check_mesh(mesh, "x").error().what, "corrupt mesh: triangle 0: material 1: expected one below 1");
  mesh.triangles = {{{0, 1, 2}, 0}};
  mesh.uvs = {{0, 0}, {0, NAN}, {1, 1}};
  EXPECT_NE(check_mesh(mesh, "x").error().what.find("expected finite ones"), std::string::npos);
  mesh.uvs.resize(2);
  EXPECT_EQ(check_mesh(mesh, "x").error().code, ErrorCode::input);
}

}  // namespace
}  // namespace voxkit
