// Meshes of voxel faces: what their files say.
#include "formats/mesh/voxel_faces.h"

#include <set>

#include "formats/image/coded_image.h"
#include "formats/little_endian.h"
#include "formats/mesh/face_palette.h"
#include "formats/mesh/voxel_grid.h"
#include "formats/output_file.h"
#include "tests/formats/mesh_file_test.h"

namespace voxkit {
namespace {

class VoxelFacesTest : public MeshReadingTest {
 protected:
  void SetUp() override {
    if (!image_codec_support(ImageFormat::png) || !reads_images()) GTEST_SKIP() << "no library for PNG";
    MeshReadingTest::SetUp();
  }

  /// The six faces of a voxel at (1, 2, 3), red to the sides, else blue.
  static std::vector<FaceRectangle> faces() {
    std::vector<FaceRectangle> faces;
    constexpr std::array<int32_t, 3> at{1, 2, 3};
    for (size_t axis = 0; axis < 3; ++axis)
      for (const bool positive : {false, true}) {
        FaceRectangle& face = faces.emplace_back();
        face.color = axis == 2 ? std::array<uint8_t, 3>{0, 0, 255} : std::array<uint8_t, 3>{255, 0, 0};
        face.axis = static_cast<uint8_t>(axis);
        face.positive = positive;
        face.plane = at[axis] + positive;
        face.lo = {at[(axis + 1) % 3], at[(axis + 2) % 3]};
        face.hi = {face.lo[0] + 1, face.lo[1] + 1};
      }
    return faces;
  }
  VolumeInfo info() const {
    VolumeInfo info = make_info({4, 5, 6}, VoxelFormat::rgba32);
    info.affine = Affine::plain({2, 2, 2}, {10, 20, 30});
    return info;
  }
  Status write(const std::string& name, const std::vector<FaceRectangle>& faces,
               const std::vector<ModelVoxel>& enclosed = {}, bool force = false) {
    VOX_TRY(const auto writer, create_faces(path(name), info(), force, ctx_));
    VOX_CHECK(writer->add(faces));
    VOX_CHECK(writer->add_enclosed(enclosed));
    return writer->finish();
  }
  /// Names that are in the folder.
  std::set<std::string> names() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_))
      names.insert(entry.path().filename());
    return names;
  }
};

TEST_F(VoxelFacesTest, ReadersFindThemWhereTheyAre) {
  for (const char* name : {"a.glb", "a.obj"}) {
    ASSERT_TRUE(write(name, faces(), {{{2, 2, 2}, {1, 2, 3}}}));
    auto mesh = read_mesh(path(name), ctx_);
    ASSERT_TRUE(mesh) << mesh.error().what;
    EXPECT_EQ(mesh->notes, std::vector<std::string>()) << name;
    EXPECT_EQ(mesh->triangles.size(), 12u);
    ASSERT_EQ(mesh->points.size(), 1u);
    EXPECT_EQ(mesh->positions[mesh->points[0].vertex], glm::dvec3(14, 24, 34));
    glm::dvec3 lo(1e300), hi(-1e300);
    for (const MeshTriangle& triangle : mesh->triangles) {
      std::array<glm::dvec3, 3> p;
      for (size_t i = 0; i < 3; ++i) {
        p[i] = mesh->positions[triangle.vertices[i]];
        for (int c = 0; c < 3; ++c) lo[c] = std::min(lo[c], p[i][c]), hi[c] = std::max(hi[c], p[i][c]);
      }
      // Red, but those that look along z.
      const glm::vec2 uv = mesh->uvs[triangle.vertices[0]];
      const auto& picture = mesh->pictures.at(0);
      ASSERT_EQ(picture.width, 2);
      ASSERT_EQ(picture.height, 2);
      const auto color = texel(*mesh, 0, static_cast<int64_t>(uv.x * 2), static_cast<int64_t>(uv.y * 2));
      const bool along_z = p[0].z == p[1].z && p[1].z == p[2].z;
      EXPECT_EQ(color, along_z ? (std::array<int, 4>{0, 0, 255, 255}) : (std::array<int, 4>{255, 0, 0, 255}));
    }
    EXPECT_EQ(lo, glm::dvec3(11, 23, 35));
    EXPECT_EQ(hi, glm::dvec3(13, 25, 37));
    ASSERT_TRUE(mesh->grid) << name;
    EXPECT_EQ(mesh->grid->dims, Index3(4, 5, 6));
    EXPECT_EQ(mesh->grid->affine, info().affine);
  }
}

// glTF 2.0: 3.6.2 (accessors), 3.11 (alignment), 4.4 (GLB).
TEST_F(VoxelFacesTest, BinaryFilesKeepTheRulesOfTheirKind) {
  ASSERT_TRUE(write("a.glb", faces(), {{{2, 2, 2}, {1, 2, 3}}}));
  const std::string file = get(path("a.glb"));
  const auto word = [&](size_t at) {
    return load_le<uint32_t>(reinterpret_cast<const std::byte*>(file.data()) + at);
  };
  EXPECT_EQ(file.substr(0, 4), "glTF");
  EXPECT_EQ(word(4), 2u);
  EXPECT_EQ(word(8), file.size());
  const size_t text_bytes = word(12), bin = 20 + text_bytes;
  EXPECT_EQ(text_bytes % 4, 0u);
  EXPECT_EQ(file.substr(16, 4), "JSON");
  EXPECT_EQ(file.substr(bin + 4, 4), std::string("BIN\0", 4));
  EXPECT_EQ(word(bin) % 4, 0u);
  EXPECT_EQ(bin + 8 + word(bin), file.size());
  const std::string text = file.substr(20, text_bytes);
  const auto says = [&](const std::string& part) {
    EXPECT_NE(text.find(part), std::string::npos) << part << " is not in " << text;
  };
  // Twenty-five vertices of three and two floats, then the corners of twelve triangles.
  says(R"("min":[0.5,1.5,2.5],"max":[1.5,2.5,3.5])");
  says(R"("min":[2.0,2.0,2.0],"max":[2.0,2.0,2.0])");
  says(R"({"buffer":0,"byteOffset":0,"byteLength":480,"byteStride":20,"target":34962})");
  says(R"({"buffer":0,"byteOffset":480,"byteLength":20,"byteStride":20,"target":34962})");
  says(R"({"buffer":0,"byteOffset":500,"byteLength":144,"target":34963})");
  says(R"("magFilter":9728,"minFilter":9728)");
  says(R"("matrix":[2.0,0.0,0.0,0,0.0,2.0,0.0,0,0.0,0.0,2.0,0,10.0,20.0,30.0,1])");
  says(R"("buffers":[{"byteLength":)" + std::to_string(word(bin)) + "}]");
  // The last triangle is that of the last three of four corners.
  EXPECT_EQ(word(bin + 8 + 500 + 144 - 12), 20u);
  EXPECT_EQ(word(bin + 8 + 500 + 144 - 4), 23u);
  EXPECT_EQ(file.substr(bin + 8 + 644, 8), "\x89PNG\r\n\x1a\n");
}

TEST_F(VoxelFacesTest, TextFilesNameTheirLibraryAndItsTexture) {
  std::vector<FaceRectangle> one{faces()[5]};
  ASSERT_TRUE(write("a b.obj", one));
  EXPECT_EQ(names(), (std::set<std::string>{"a b.mtl", "a b.obj", "a b.png"}));
  EXPECT_EQ(get(path("a b.mtl")), "newmtl palette\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd a b.png\n");
  EXPECT_EQ(get(path("a b.obj")),
            "# voxel_grid {\"dims\":[4,5,6],\"axes\":[[2.0,0.0,0.0],[0.0,2.0,0.0],[0.0,0.0,2.0]],"
            "\"origin\":[10.0,20.0,30.0]}\n"
            "mtllib a b.mtl\no surface\nusemtl palette\nvt 0.5 0.5\n"
            "v 11 23 37\nv 13 23 37\nv 13 25 37\nv 11 25 37\nf 1/1 2/1 3/1 4/1\n");
}

TEST_F(VoxelFacesTest, FacesOfOnePlaneShareCorners) {
  std::vector<FaceRectangle> two{faces()[5], faces()[5]};
  two[1].lo[0] += 1, two[1].hi[0] += 1;
  two[1].color = {9, 9, 9};
  ASSERT_TRUE(write("a.obj", two));
  const std::string text = get(path("a.obj"));
  EXPECT_NE(text.find("f 1/1 2/1 3/1 4/1\nv 15 23 37\nv 15 25 37\nf 2/2 5/2 6/2 3/2\n"), std::string::npos)
      << text;
}

TEST_F(VoxelFacesTest, FilesAppearTogetherOrNotAtAll) {
  put("a.png", "old");
  const Status exists = write("a.obj", faces());
  ASSERT_FALSE(exists);
  EXPECT_EQ(exists.error().code, ErrorCode::output);
  EXPECT_EQ(exists.error().file, path("a.png"));
  EXPECT_EQ(names(), (std::set<std::string>{"a.png"}));
  EXPECT_EQ(get(path("a.png")), "old");
  { ASSERT_TRUE(create_faces(path("b.obj"), info(), false, ctx_)); }  // begun, and left
  EXPECT_EQ(names(), (std::set<std::string>{"a.png"}));
  ASSERT_TRUE(write("a.obj", faces(), {}, true));
  EXPECT_EQ(names(), (std::set<std::string>{"a.mtl", "a.obj", "a.png"}));
}

TEST_F(VoxelFacesTest, WhatCannotBeIsRefused) {
  const auto refused = [&](const std::string& name, const std::vector<FaceRectangle>& faces, ErrorCode code) {
    const Status status = write(name, faces);
    ASSERT_FALSE(status) << name;
    EXPECT_EQ(status.error().code, code) << name;
    EXPECT_EQ(names(), std::set<std::string>()) << name;
  };
  refused("a.glb", {}, ErrorCode::input);
  refused("a.obj", {}, ErrorCode::input);
  refused("a.stl", faces(), ErrorCode::usage);
  refused("a\nb.obj", faces(), ErrorCode::usage);
  refused(" a.obj", faces(), ErrorCode::usage);
}

TEST_F(VoxelFacesTest, PalettesAreInOrderAndOfExactPlaces) {
  FacePalette palette;
  for (const int red : {200, 3, 77, 3}) palette.add({static_cast<uint8_t>(red), 1, 2});
  palette.add({3, 0, 255});
  palette.add({255, 255, 255});
  palette.arrange();
  EXPECT_EQ(palette.count(), 5u);
  EXPECT_EQ(palette.width(), 4u);
  EXPECT_EQ(palette.height(), 2u);
  EXPECT_EQ(palette.index_of({3, 0, 255}), 0u);
  EXPECT_EQ(palette.index_of({3, 1, 2}), 1u);
  EXPECT_EQ(palette.index_of({200, 1, 2}), 3u);
  EXPECT_EQ(palette.index_of({255, 255, 255}), 4u);
  EXPECT_EQ(palette.texel(3), (std::array<double, 2>{0.875, 0.25}));
  EXPECT_EQ(palette.texel(4), (std::array<double, 2>{0.125, 0.75}));
  const auto png = palette.png(ctx_);
  ASSERT_TRUE(png) << png.error().what;
  const auto image = decode_image(ImageFormat::png, *png, {4, 2});
  ASSERT_TRUE(image) << image.error().what;
  const std::vector<int> expected{3,   0,   255, 3, 1, 2, 77, 1, 2, 200, 1, 2,
                                  255, 255, 255, 0, 0, 0, 0,  0, 0, 0,   0, 0};
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(static_cast<int>(image->rgb[i]), expected[i]) << i;
}

TEST(VoxelGridTest, TextsComeBack) {
  VolumeInfo info;
  info.dims = {1, 2097152, 3};
  info.affine.axes = {{{0.1, -2, 1e-9}, {3, 0.30000000000000004, 0}, {0, 0, 1e30}}};
  info.affine.origin = {-1, 2.5, 1.0 / 3};
  info.world = World::left_handed;
  info.unit = Unit::angstrom;
  info.space_code = 4;
  info.description = "a\tb \xc3\xa9 \"c\"";
  const std::string text = voxel_grid_text(info);
  EXPECT_EQ(text.find_first_of("\n\t"), text.npos);
  const auto back = parse_voxel_grid(text);
  ASSERT_TRUE(back) << text;
  EXPECT_EQ(back->dims, info.dims);
  EXPECT_EQ(back->affine, info.affine);
  EXPECT_EQ(back->world, info.world);
  EXPECT_EQ(back->unit, info.unit);
  EXPECT_EQ(back->space_code, 4);
  EXPECT_EQ(back->description, "a b \xc3\xa9 \"c\"");
}

TEST(VoxelGridTest, WhatNoGridCanHaveIsNone) {
  const std::string axes = R"("axes":[[1,0,0],[0,1,0],[0,0,1]])", dims = R"("dims":[1,2,3])",
                    origin = R"("origin":[0,0,0])";
  EXPECT_TRUE(parse_voxel_grid("{" + dims + "," + axes + "," + origin + "}"));
  for (const std::string& text : {std::string(),
                                  std::string("{"),
                                  std::string("[]"),
                                  std::string("null"),
                                  "{" + dims + "," + axes + "}",
                                  "{" + dims + "," + origin + "}",
                                  "{" + axes + "," + origin + "}",
                                  R"({"dims":[0,2,3],)" + axes + "," + origin + "}",
                                  R"({"dims":[2097153,2,3],)" + axes + "," + origin + "}",
                                  R"({"dims":[2097152,2097152,2097152],)" + axes + "," + origin + "}",
                                  R"({"dims":[-1,2,3],)" + axes + "," + origin + "}",
                                  R"({"dims":[1,2],)" + axes + "," + origin + "}",
                                  R"({"dims":[1.5,2,3],)" + axes + "," + origin + "}",
                                  "{" + dims + R"(,"axes":[[1,0,0],[2,0,0],[0,0,1]],)" + origin + "}",
                                  "{" + dims + R"(,"axes":[[1,0,0],[0,1],[0,0,1]],)" + origin + "}",
                                  "{" + dims + R"(,"axes":[[1e999,0,0],[0,1,0],[0,0,1]],)" + origin + "}",
                                  "{" + dims + R"(,"axes":"x",)" + origin + "}",
                                  "{" + dims + "," + axes + R"(,"origin":[0,0,"0"]})",
                                  std::string(100000, '['),
                                  "{" + dims + "," + axes + "," + origin + std::string(70000, ' ') + "}"})
    EXPECT_FALSE(parse_voxel_grid(text)) << text.substr(0, 100);
}

using VoxelGridReadingTest = MeshReadingTest;

TEST_F(VoxelGridReadingTest, NodesCarryTheirGrids) {
  GltfFile file;
  file.primitives =
      fmt::format(R"({{"attributes":{{"POSITION":{}}},"indices":{}}})", file.square(), file.square_corners());
  const std::string grid =
      R"("extras":{"voxel_grid":{"dims":[2,3,4],"axes":[[1,0,0],[0,1,0],[0,0,1]],"origin":[1,1,1]}})";
  file.nodes = R"([{"mesh":0,"translation":[10,0,0],"scale":[2,2,4],)" + grid + "}]";
  const Mesh mesh = read("a.gltf", file.json());
  ASSERT_TRUE(mesh.grid);
  EXPECT_EQ(mesh.grid->dims, Index3(2, 3, 4));
  EXPECT_EQ(mesh.grid->affine, Affine::plain({2, 2, 4}, {12, 2, 4}));
  // Two of them are none; so is one that says nothing.
  file.nodes = R"([{"mesh":0,)" + grid + R"(},{)" + grid + "}]";
  file.scenes = R"([{"nodes":[0,1]}])";
  EXPECT_FALSE(read("b.gltf", file.json()).grid);
  file.nodes = R"([{"mesh":0,"extras":{"voxel_grid":[1]}},{"extras":7}])";
  EXPECT_FALSE(read("c.gltf", file.json()).grid);
}

TEST_F(VoxelGridReadingTest, MirroredNodesShowTheOtherSide) {
  GltfFile file;
  file.primitives =
      fmt::format(R"({{"attributes":{{"POSITION":{}}},"indices":{}}})", file.square(), file.square_corners());
  for (const int sign : {1, -1}) {
    file.nodes = fmt::format(R"([{{"mesh":0,"scale":[{},1,1]}}])", sign);
    const Mesh mesh = read("a.gltf", file.json());
    for (const MeshTriangle& triangle : mesh.triangles) {
      const glm::dvec3 a = mesh.positions[triangle.vertices[0]], b = mesh.positions[triangle.vertices[1]],
                       c = mesh.positions[triangle.vertices[2]];
      EXPECT_GT((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x), 0) << sign;
    }
  }
}

}  // namespace
}  // namespace voxkit
