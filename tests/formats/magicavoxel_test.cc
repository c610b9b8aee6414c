// MagicaVoxel files: models, palettes, scenes, and files that are none.
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>

#include "formats/mesh/magicavoxel.h"

namespace voxkit {
namespace {

using Place = std::array<int32_t, 3>;
using Color = std::array<uint8_t, 3>;

std::string number(uint32_t value) {
  std::string bytes(4, '\0');
  std::memcpy(bytes.data(), &value, 4);
  return bytes;
}
std::string text(const std::string& words) {
  return number(static_cast<uint32_t>(words.size())) + words;
}
std::string dictionary(const std::map<std::string, std::string>& words) {
  std::string bytes = number(static_cast<uint32_t>(words.size()));
  for (const auto& [key, value] : words) bytes += text(key) + text(value);
  return bytes;
}
std::string chunk(const std::string& kind, const std::string& own, const std::string& children = "") {
  return kind + number(static_cast<uint32_t>(own.size())) + number(static_cast<uint32_t>(children.size())) +
         own + children;
}
std::string file(const std::string& chunks) {
  return "VOX " + number(150) + chunk("MAIN", "", chunks);
}
std::string model(uint32_t x, uint32_t y, uint32_t z, const std::vector<std::array<uint8_t, 4>>& voxels) {
  std::string own = number(static_cast<uint32_t>(voxels.size()));
  for (const auto& v : voxels) own.append(reinterpret_cast<const char*>(v.data()), 4);
  return chunk("SIZE", number(x) + number(y) + number(z)) + chunk("XYZI", own);
}
std::string transform(uint32_t id, uint32_t child, const std::map<std::string, std::string>& frame,
                      const std::map<std::string, std::string>& attributes = {}, uint32_t layer = ~0u) {
  return chunk("nTRN", number(id) + dictionary(attributes) + number(child) + number(~0u) + number(layer) +
                           number(1) + dictionary(frame));
}
std::string group(uint32_t id, const std::vector<uint32_t>& children) {
  std::string own = number(id) + dictionary({}) + number(static_cast<uint32_t>(children.size()));
  for (const uint32_t child : children) own += number(child);
  return chunk("nGRP", own);
}
std::string shape(uint32_t id, uint32_t model) {
  return chunk("nSHP", number(id) + dictionary({}) + number(1) + number(model) + dictionary({}));
}

class MagicaVoxel : public testing::Test {
 protected:
  Result<VoxelScene> read(const std::string& bytes, uint32_t frame = 0) {
    const auto path = std::filesystem::temp_directory_path() /
                      ("voxkit-" + std::to_string(getpid()) + "-" +
                       testing::UnitTest::GetInstance()->current_test_info()->name() + ".vox");
    std::ofstream(path, std::ios::binary) << bytes;
    auto scene = read_magicavoxel(path.string(), ctx_, frame);
    std::filesystem::remove(path);
    return scene;
  }
  std::vector<Place> places(const std::string& bytes, uint32_t frame = 0) {
    auto scene = read(bytes, frame);
    EXPECT_TRUE(scene) << scene.error().what;
    std::vector<Place> all;
    if (scene)
      for (const ModelVoxel& v : scene->voxels) all.push_back(v.place);
    return all;
  }
  void expect_refused(const std::string& bytes, const std::string& rule) {
    const auto scene = read(bytes);
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().code, ErrorCode::input);
    EXPECT_NE(scene.error().what.find(rule), std::string::npos) << scene.error().what;
  }
  MagicaVoxel() { ctx_.memory = &memory_; }
  MemoryBudget memory_{1 << 20};
  Context ctx_;
};

TEST_F(MagicaVoxel, AModelWithItsPalette) {
  std::string palette(1024, '\0');
  palette[4 * 6] = 10, palette[4 * 6 + 1] = 20, palette[4 * 6 + 2] = 30;
  const auto scene = read(file(model(3, 4, 5, {{2, 1, 4, 7}}) + chunk("RGBA", palette)));
  ASSERT_TRUE(scene) << scene.error().what;
  ASSERT_EQ(scene->voxels.size(), 1u);
  // z of the file is up: y here.
  EXPECT_EQ(scene->voxels[0].place, (Place{2, 4, -2}));
  EXPECT_EQ(scene->voxels[0].color, (Color{10, 20, 30}));
}

TEST_F(MagicaVoxel, TheDefaultPalette) {
  const auto scene = read(
      file(model(1, 1, 1, {{0, 0, 0, 1}, {0, 0, 0, 2}, {0, 0, 0, 215}, {0, 0, 0, 216}, {0, 0, 0, 255}})));
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene->voxels[0].color, (Color{255, 255, 255}));
  EXPECT_EQ(scene->voxels[1].color, (Color{255, 255, 0xcc}));
  EXPECT_EQ(scene->voxels[2].color, (Color{0, 0, 0x33}));
  EXPECT_EQ(scene->voxels[3].color, (Color{0xee, 0, 0}));
  EXPECT_EQ(scene->voxels[4].color, (Color{0x11, 0x11, 0x11}));
}

TEST_F(MagicaVoxel, ModelsTurnAboutTheirMiddle) {
  const std::string one = model(3, 3, 3, {{2, 1, 1, 1}});
  const auto scene_of = [&](const std::map<std::string, std::string>& frame) {
    return file(one + transform(0, 1, {}) + group(1, {2}) + transform(2, 3, frame) + shape(3, 0));
  };
  EXPECT_EQ(places(scene_of({})), (std::vector<Place>{{1, 0, -1}}));
  EXPECT_EQ(places(scene_of({{"_t", "10 20 -5"}})), (std::vector<Place>{{11, -5, -21}}));
  // x goes to y: row 0 is -y, row 1 is x, row 2 is z. A turn of a voxel (1, 0, 0) is (-1, 1, 0).
  EXPECT_EQ(places(scene_of({{"_r", std::to_string(1 | 0 << 2 | 1 << 4)}})),
            (std::vector<Place>{{-1, 0, -2}}));
  // Models of even sides lie evenly about the middle: mirrored in x they are where they were.
  const std::string even = model(2, 2, 2, {{0, 0, 0, 1}, {1, 0, 0, 2}}) +
                           transform(0, 1, {{"_r", std::to_string(0 | 1 << 2 | 1 << 4)}}) + shape(1, 0);
  EXPECT_EQ(places(file(even)), (std::vector<Place>{{0, -1, 0}, {-1, -1, 0}}));
}

TEST_F(MagicaVoxel, HiddenPartsAreLeftOut) {
  const std::string two = model(1, 1, 1, {{0, 0, 0, 1}}) + transform(0, 1, {}) + group(1, {2, 4}) +
                          transform(2, 3, {{"_t", "5 0 0"}}, {{"_hidden", "1"}}) + shape(3, 0);
  EXPECT_EQ(places(file(two + transform(4, 5, {{"_t", "7 0 0"}}) + shape(5, 0))),
            (std::vector<Place>{{7, 0, -1}}));
  EXPECT_EQ(places(file(two + transform(4, 5, {}, {}, 3) + shape(5, 0) +
                        chunk("LAYR", number(3) + dictionary({{"_hidden", "1"}}) + number(~0u)))),
            (std::vector<Place>{}));
}

TEST_F(MagicaVoxel, FramesOfAScene) {
  // A shape of two models, the second from frame 5 on, which moves at frame 2.
  const std::string models = model(1, 1, 1, {{0, 0, 0, 1}}) + model(3, 1, 1, {{2, 0, 0, 2}});
  const std::string moving = chunk(
      "nTRN", number(0) + dictionary({}) + number(1) + number(~0u) + number(~0u) + number(2) +
                  dictionary({{"_t", "10 0 0"}, {"_f", "0"}}) + dictionary({{"_t", "20 0 0"}, {"_f", "2"}}));
  const std::string shapes =
      chunk("nSHP", number(1) + dictionary({}) + number(2) + number(0) + dictionary({{"_f", "0"}}) +
                        number(1) + dictionary({{"_f", "5"}}));
  const std::string scene = file(models + moving + shapes);
  EXPECT_EQ(places(scene), (std::vector<Place>{{10, 0, -1}}));
  EXPECT_EQ(places(scene, 1), (std::vector<Place>{{10, 0, -1}}));
  EXPECT_EQ(places(scene, 2), (std::vector<Place>{{20, 0, -1}}));
  EXPECT_EQ(places(scene, 4), (std::vector<Place>{{20, 0, -1}}));
  EXPECT_EQ(places(scene, 5), (std::vector<Place>{{21, 0, -1}}));
  ASSERT_EQ(read(scene)->notes.size(), 1u);
  EXPECT_EQ(read(scene)->notes[0], "frame 0 of 6 is read: --frame N takes another");
  const auto none = read(scene, 6);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::usage);
  expect_refused(
      file(models + moving +
           chunk("nSHP", number(1) + dictionary({}) + number(1) + number(0) + dictionary({{"_f", "x"}}))),
      "frame \"x\"");
}

TEST_F(MagicaVoxel, ModelsWithoutASceneAreFrames) {
  const std::string pack =
      file(chunk("PACK", number(2)) + model(1, 1, 1, {{0, 0, 0, 1}}) + model(2, 1, 1, {{1, 0, 0, 1}}));
  EXPECT_EQ(places(pack), (std::vector<Place>{{0, 0, -1}}));
  EXPECT_EQ(places(pack, 1), (std::vector<Place>{{1, 0, -1}}));
  EXPECT_FALSE(read(pack, 2));
  EXPECT_EQ(read(pack)->notes.size(), 1u);
  EXPECT_TRUE(read(file(model(1, 1, 1, {{0, 0, 0, 1}})))->notes.empty());
}

TEST_F(MagicaVoxel, HiddenPartsAreNoted) {
  const auto hidden =
      read(file(model(1, 1, 1, {{0, 0, 0, 1}}) + transform(0, 1, {}, {{"_hidden", "1"}}) + shape(1, 0)));
  ASSERT_TRUE(hidden);
  EXPECT_EQ(hidden->notes, (std::vector<std::string>{"dropped: 1 parts of the scene that are hidden"}));
}

TEST_F(MagicaVoxel, MaterialsOfColors) {
  const auto material = [](uint32_t id, std::map<std::string, std::string> words, const std::string& type) {
    if (!type.empty()) words["_type"] = type;
    return chunk("MATL", number(id) + dictionary(words));
  };
  const auto scene = read(file(
      model(1, 1, 1, {{0, 0, 0, 1}}) + material(1, {{"_trans", "0.9"}, {"_alpha", "0.1"}}, "_glass") +
      material(2, {{"_emit", "0.5"}}, "_emit") + material(3, {{"_emit", "0.5"}, {"_flux", "2"}}, "_emit") +
      material(4, {{"_metal", "0.75"}, {"_rough", "0.25"}}, "_metal") + material(5, {}, "_media") +
      material(6, {{"_weight", "0.5"}}, "_glass") + material(7, {{"_emit", "nan"}}, "_emit") +
      material(8, {{"_rough", "0.3"}}, "") + material(4000, {}, "_emit")));
  ASSERT_TRUE(scene) << scene.error().what;
  const auto& m = scene->materials;
  EXPECT_EQ(scene->voxels.at(0).number, 1);
  EXPECT_NEAR(m[1].opacity, 0.1, 1e-6);
  EXPECT_EQ(m[2].emission, 0.5f);
  EXPECT_EQ(m[3].emission, 1);
  EXPECT_EQ(m[4].metalness, 0.75f);
  EXPECT_EQ(m[4].roughness, 0.25f);
  EXPECT_TRUE(m[5].special);
  EXPECT_EQ(m[6].opacity, 0.5f);
  EXPECT_EQ(m[7].emission, 1);
  EXPECT_EQ(m[8].roughness, 1);
  EXPECT_EQ(m[9].opacity, 1);
  EXPECT_TRUE(scene->notes.empty());
}

TEST_F(MagicaVoxel, BrokenFilesAreRefused) {
  const std::string good =
      file(model(2, 2, 2, {{0, 0, 0, 1}}) + transform(0, 1, {{"_t", "1 2 3"}}) + shape(1, 0));
  ASSERT_TRUE(read(good));
  for (size_t length = 0; length < good.size(); ++length)
    EXPECT_FALSE(read(good.substr(0, length))) << length;
  expect_refused("RIFF" + good.substr(4), "not a MagicaVoxel file");
  expect_refused("VOX " + number(7) + good.substr(8), "version 7");
  expect_refused(file(model(2, 2, 2, {{2, 0, 0, 1}})), "coordinate 2: expected below 2");
  expect_refused(file(model(2, 257, 2, {})), "a side of 257");
  expect_refused(file(chunk("XYZI", number(0))), "expected a chunk SIZE");
  expect_refused(file(""), "no model");
  const std::string one = model(1, 1, 1, {{0, 0, 0, 1}});
  expect_refused(file(one + transform(0, 1, {})), "node 1: not there");
  expect_refused(file(one + transform(0, 1, {}) + shape(1, 4)), "model 4: there are 1");
  expect_refused(file(one + group(0, {0})), "64 nodes deep");
  expect_refused(file(one + transform(0, 1, {{"_t", "1 2"}}) + shape(1, 0)), "translation");
  expect_refused(file(one + transform(0, 1, {{"_t", "1 2 99999999"}}) + shape(1, 0)), "translation");
  expect_refused(file(one + transform(0, 1, {{"_r", "5"}}) + shape(1, 0)), "rotation");
}

TEST_F(MagicaVoxel, WhatIsWrittenIsReadInItsPlace) {
  // Several models on each axis, the last ones smaller.
  const Index3 dims(300, 513, 257);
  const std::vector<Color> palette{{1, 2, 3}, {0, 0, 0}, {255, 254, 253}};
  std::map<Place, Color> expected;
  std::vector<IndexedVoxel> voxels;
  uint32_t random = 1;
  for (int i = 0; i < 3000; ++i) {
    IndexedVoxel v{};
    for (size_t a = 0; a < 3; ++a) {
      random = random * 1664525 + 1013904223;
      const auto side = static_cast<uint32_t>(dims[static_cast<Index3::length_type>(a)]);
      v.place[a] = static_cast<int32_t>((random >> 8) % side);
    }
    v.color = static_cast<uint8_t>(i % 3);
    if (expected.emplace(v.place, palette[v.color]).second) voxels.push_back(v);
  }
  const std::string path =
      (std::filesystem::temp_directory_path() / ("voxkit-" + std::to_string(getpid()) + "-written.vox"))
          .string();
  VolumeInfo info;
  info.dims = dims;
  info.affine = Affine::plain({1, 1, 1}, {10.5, -399.5, 7.5});
  std::vector<std::string> notes;
  ctx_.note = [&notes](const std::string& line) { notes.push_back(line); };
  auto writer = create_magicavoxel(path, info, voxels.size(), palette, false, ctx_);
  ASSERT_TRUE(writer) << writer.error().what;
  ASSERT_TRUE((*writer)->add(std::span(voxels).first(1000)));
  ASSERT_TRUE((*writer)->add(std::span(voxels).subspan(1000)));
  EXPECT_FALSE(std::filesystem::exists(path));
  ASSERT_TRUE((*writer)->finish());
  const auto scene = read_magicavoxel(path, ctx_);
  std::filesystem::remove(path);
  ASSERT_TRUE(scene) << scene.error().what;
  std::map<Place, Color> found;
  for (const ModelVoxel& v : scene->voxels)
    found.emplace(Place{v.place[0] - 10, v.place[1] + 400, v.place[2] - 7}, v.color);
  EXPECT_EQ(found, expected);
  EXPECT_TRUE(notes.empty()) << notes.front();

  // What a scene cannot say of a place is said.
  info.affine = Affine::plain({0.5, 0.5, 0.5}, {0.25, 0.3, 0.25});
  ASSERT_TRUE(create_magicavoxel(path, info, 1, palette, false, ctx_));
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("the edges of voxels and where the volume is"), std::string::npos) << notes[0];

  for (const auto& [side, count] :
       {std::pair<int64_t, uint64_t>{(1 << 20) + 1, 1}, {100, uint64_t{1} << 29}}) {
    info.dims = Index3(side, 9, 9);
    const auto large = create_magicavoxel(path, info, count, palette, false, ctx_);
    ASSERT_FALSE(large);
    EXPECT_EQ(large.error().code, ErrorCode::limit);
  }
}

/// Groups that have the next one ten times over: 10^9 models.
TEST_F(MagicaVoxel, ABombOfNodesReachesTheLimit) {
  std::string nodes = model(1, 1, 1, {{0, 0, 0, 1}});
  for (uint32_t i = 0; i < 9; ++i) nodes += group(i, std::vector<uint32_t>(10, i + 1));
  const auto scene = read(file(nodes + shape(9, 0)));
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::limit);
  // Of nothing at all.
  std::string empty = model(1, 1, 1, {{0, 0, 0, 1}});
  for (uint32_t i = 0; i < 9; ++i) empty += group(i, std::vector<uint32_t>(10, i + 1));
  expect_refused(file(empty + group(9, {})), "nodes to place");
}

}  // namespace
}  // namespace voxkit
