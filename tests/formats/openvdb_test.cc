#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "formats/module.h"
#include "tests/formats/file_format_test.h"

namespace voxkit {
namespace {

template <class Set>
OpenOptions with(const Set& set) {
  OpenOptions options;
  set(options);
  return options;
}

OpenOptions grid_named(const std::string& name) {
  OpenOptions options;
  options.grid = name;
  return options;
}

class OpenVdb : public FileFormatTest {
 protected:
  void SetUp() override {
    FileFormatTest::SetUp();
    if (!std::filesystem::exists(module_folder() + "/openvdb.so")) GTEST_SKIP() << "built without OpenVDB";
  }

  Status write_vdb(const std::string& name, const VolumeInfo& info, const Bytes& voxels) {
    VOX_TRY(const auto sink, create_vdb(path(name), info, true, ctx_));
    return write(*sink, info, voxels);
  }
  /// Opens, with the whole volume in `voxels`.
  std::unique_ptr<VolumeSource> read_vdb(const std::string& name, Bytes& voxels,
                                         const std::string& grid = {}) {
    auto source = open_vdb(path(name), grid_named(grid), ctx_);
    EXPECT_TRUE(source) << source.error().what;
    if (!source) return nullptr;
    auto all = read(**source);
    EXPECT_TRUE(all) << all.error().what;
    if (all) voxels = *all;
    return std::move(*source);
  }

  /// Random values among zeros, with a flat part: a grid of leaves, tiles and background.
  std::vector<float> sparse(Index3 dims) {
    std::vector<float> values(static_cast<size_t>(dims.x * dims.y * dims.z));
    size_t i = 0;
    for (int64_t z = 0; z < dims.z; ++z)
      for (int64_t y = 0; y < dims.y; ++y)
        for (int64_t x = 0; x < dims.x; ++x, ++i)
          values[i] = x / 16 % 2       ? (y < 24 ? 2.5f : 0)
                      : z / 8 % 3 == 1 ? static_cast<float>(random_() % 5)
                                       : 0;
    return values;
  }
  static Bytes bytes_of(const std::vector<float>& values) {
    Bytes bytes(values.size() * 4);
    std::memcpy(bytes.data(), values.data(), bytes.size());
    return bytes;
  }
  static std::vector<float> floats_of(const Bytes& bytes) {
    std::vector<float> values(bytes.size() / 4);
    std::memcpy(values.data(), bytes.data(), bytes.size());
    return values;
  }

  static std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    if (at != std::string::npos) text.replace(at, from.size(), to);
    return text;
  }
};

TEST_F(OpenVdb, FloatsComeBackWithPlaceAndEmptyBorders) {
  for (const Index3 dims : {Index3(1, 1, 1), Index3(8, 8, 8), Index3(13, 7, 5), Index3(150, 9, 20)}) {
    VolumeInfo info = make_info(dims, VoxelFormat::float32, SampleType::f32);
    info.affine = Affine::plain({0.5, 2, 0.25}, info.affine.origin);
    info.affine.origin = {10, -20, 0.125};
    Bytes voxels = random_voxels(info);
    // An empty first slice: without the extent the active voxels would begin at z = 1.
    if (dims.z > 1) std::fill_n(voxels.begin(), dims.x * dims.y * 4, std::byte{0});
    ASSERT_TRUE(write_vdb("a.vdb", info, voxels));
    Bytes back;
    const auto source = read_vdb("a.vdb", back);
    ASSERT_TRUE(source);
    EXPECT_EQ(source->info().dims, dims);
    EXPECT_EQ(source->info().format, VoxelFormat::float32);
    EXPECT_EQ(source->info().affine.spacing(), info.affine.spacing());
    EXPECT_EQ(source->info().affine.origin, info.affine.origin);
    EXPECT_EQ(back, voxels);
  }
}

TEST_F(OpenVdb, IntegersAreKeptAsTheirSampleValues) {
  for (const SampleType type :
       {SampleType::u8, SampleType::i8, SampleType::u16, SampleType::i16, SampleType::bit}) {
    const VolumeInfo info = make_info({9, 4, 3}, scalar_format(type), type);
    const Bytes voxels = random_voxels(info);
    ASSERT_TRUE(write_vdb("a.vdb", info, voxels));
    Bytes back;
    ASSERT_TRUE(read_vdb("a.vdb", back));
    const auto values = floats_of(back);
    const size_t bytes = static_cast<size_t>(voxel_bytes(info.format));
    ASSERT_EQ(values.size() * bytes, voxels.size());
    for (size_t i = 0; i < values.size(); ++i) {
      const int stored = static_cast<int>(voxels[i * bytes]) |
                         (bytes == 2 ? static_cast<int>(voxels[i * bytes + 1]) << 8 : 0);
      ASSERT_EQ(values[i], static_cast<float>(stored - info.bias()));
    }
  }
}

TEST_F(OpenVdb, VoxelsOneByOneAreTheSameAsSlabs) {
  const VolumeInfo info = make_info({20, 300, 9}, VoxelFormat::rgba32);
  Bytes voxels(static_cast<size_t>(info.dims.x * info.dims.y * info.dims.z * 4));
  std::vector<ModelVoxel> list;
  for (int i = 0; i < 500; ++i) {
    const std::array<int32_t, 3> at{static_cast<int32_t>(random_() % 20),
                                    static_cast<int32_t>(random_() % 300),
                                    static_cast<int32_t>(random_() % 9)};
    std::byte* const voxel = voxels.data() + ((at[2] * 300 + at[1]) * 20 + at[0]) * 4;
    if (voxel[3] != std::byte{0}) continue;
    const ModelVoxel v{at, {static_cast<uint8_t>(random_()), static_cast<uint8_t>(i), 7}};
    for (size_t c = 0; c < 3; ++c) voxel[c] = std::byte{v.color[c]};
    voxel[3] = std::byte{255};
    list.push_back(v);
  }
  auto sink = create_vdb_voxels(path("one.vdb"), info, true, ctx_);
  ASSERT_TRUE(sink) << sink.error().what;
  ASSERT_TRUE((*sink)->add(std::span(list).first(200)));
  ASSERT_TRUE((*sink)->add(std::span(list).subspan(200)));
  EXPECT_FALSE(std::filesystem::exists(path("one.vdb")));
  ASSERT_TRUE((*sink)->finish());
  ASSERT_TRUE(write_vdb("slabs.vdb", info, voxels));
  Bytes one, slabs;
  const auto source = read_vdb("one.vdb", one);
  ASSERT_TRUE(source && read_vdb("slabs.vdb", slabs));
  EXPECT_EQ(source->info().dims, info.dims);
  EXPECT_EQ(one, slabs);
  EXPECT_EQ(one, voxels);
}

TEST_F(OpenVdb, HugeVolumesOfFewVoxelsAreFast) {
  const VolumeInfo info = make_info({1 << 20, 1 << 20, 1 << 20}, VoxelFormat::rgba32);
  auto sink = create_vdb_voxels(path("a.vdb"), info, true, ctx_);
  ASSERT_TRUE(sink);
  const std::vector<ModelVoxel> list{{{5, 6, 7}, {1, 2, 3}}, {{1000000, 1000001, 1000002}, {4, 5, 6}}};
  ASSERT_TRUE((*sink)->add(list));
  ASSERT_TRUE((*sink)->finish());
  const auto source = open_vdb(path("a.vdb"), {}, ctx_);
  ASSERT_TRUE(source);
  // A walk over all places would not end.
  EXPECT_FALSE((*source)->uniform((*source)->info().box()));
  EXPECT_EQ((*source)->uniform({{0, 0, 4096}, {1 << 19, 1 << 19, 1 << 19}}), Voxel{});
}

TEST_F(OpenVdb, ColorsComeBackAndVoidIsBlack) {
  const VolumeInfo rgba = make_info({20, 11, 9}, VoxelFormat::rgba32);
  Bytes voxels = random_voxels(rgba);
  for (size_t i = 0; i < voxels.size(); i += 4) voxels[i + 3] = std::byte(random_() % 2 ? 255 : 0);
  ASSERT_TRUE(write_vdb("a.vdb", rgba, voxels));
  Bytes back;
  const auto source = read_vdb("a.vdb", back);
  ASSERT_TRUE(source);
  EXPECT_EQ(source->info().format, VoxelFormat::rgba32);
  for (size_t i = 0; i < voxels.size(); i += 4)
    if (voxels[i + 3] == std::byte{0}) std::fill_n(voxels.begin() + static_cast<int64_t>(i), 3, std::byte{0});
  EXPECT_EQ(back, voxels);

  const VolumeInfo rgb = make_info({5, 6, 7}, VoxelFormat::rgb24);
  voxels = random_voxels(rgb);
  ASSERT_TRUE(write_vdb("b.vdb", rgb, voxels));
  ASSERT_TRUE(read_vdb("b.vdb", back));
  ASSERT_EQ(back.size() / 4, voxels.size() / 3);
  for (size_t i = 0; i < voxels.size() / 3; ++i) {
    ASSERT_TRUE(std::equal(&voxels[i * 3], &voxels[i * 3] + 3, &back[i * 4]));
    ASSERT_EQ(back[i * 4 + 3], std::byte{255});
  }
}

TEST_F(OpenVdb, SameVolumeGivesSameBytes) {
  const VolumeInfo info = make_info({40, 30, 20}, VoxelFormat::float32, SampleType::f32);
  const Bytes voxels = bytes_of(sparse(info.dims));
  ASSERT_TRUE(write_vdb("a.vdb", info, voxels));
  ASSERT_TRUE(write_vdb("b.vdb", info, voxels));
  EXPECT_EQ(get(path("a.vdb")), get(path("b.vdb")));
}

TEST_F(OpenVdb, BoxesFromManyThreadsAreThoseOfTheWhole) {
  const VolumeInfo info = make_info({140, 50, 40}, VoxelFormat::float32, SampleType::f32);
  const auto values = sparse(info.dims);
  ASSERT_TRUE(write_vdb("a.vdb", info, bytes_of(values)));
  auto source = open_vdb(path("a.vdb"), {}, ctx_);
  ASSERT_TRUE(source);
  std::array<int, 4> wrong{};
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      std::mt19937 random(t);
      for (int i = 0; i < 200; ++i) {
        Box box;
        for (int a = 0; a < 3; ++a) {
          box.lo[a] = random() % info.dims[a];
          box.hi[a] = box.lo[a] + 1 + random() % (info.dims[a] - box.lo[a]);
        }
        std::vector<float> part(static_cast<size_t>(box.voxels()));
        wrong[t] +=
            !(*source)->read(box, packed(reinterpret_cast<std::byte*>(part.data()), box.size(), info.format));
        const auto known = (*source)->uniform(box);
        size_t n = 0;
        for (int64_t z = box.lo.z; z < box.hi.z; ++z)
          for (int64_t y = box.lo.y; y < box.hi.y; ++y)
            for (int64_t x = box.lo.x; x < box.hi.x; ++x, ++n) {
              wrong[t] += part[n] != values[static_cast<size_t>((z * info.dims.y + y) * info.dims.x + x)];
              wrong[t] += known && known->as<float>() != part[n];
            }
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, (std::array<int, 4>{}));
}

TEST_F(OpenVdb, TilesAreKnownToBeUniform) {
  const VolumeInfo info = make_info({600, 24, 24}, VoxelFormat::float32, SampleType::f32);
  std::vector<float> values(600 * 24 * 24);
  for (size_t i = 0; i < values.size(); ++i) values[i] = i % 600 < 16 ? 3.0f : i % 600 == 17 ? 1.0f : 0.0f;
  ASSERT_TRUE(write_vdb("a.vdb", info, bytes_of(values)));
  const auto source = open_vdb(path("a.vdb"), {}, ctx_);
  ASSERT_TRUE(source);
  EXPECT_EQ((*source)->uniform({{0, 0, 0}, {16, 24, 24}}), Voxel::of(3.0f));
  EXPECT_EQ((*source)->uniform({{3, 5, 7}, {5, 7, 9}}), Voxel::of(3.0f));
  EXPECT_EQ((*source)->uniform({{24, 0, 0}, {600, 24, 24}}), Voxel::of(0.0f));
  EXPECT_FALSE((*source)->uniform({{0, 0, 0}, {25, 1, 1}}));
  EXPECT_FALSE((*source)->uniform({{16, 0, 0}, {24, 8, 8}}));
}

/// A file of two grids from two files of one, by hand.
std::string joined(const std::string& a, const std::string& b) {
  const size_t count_at = 21 + 36 + 4;  // after the header and an empty map of metadata
  const auto shifted = [](std::string grid, int64_t by) {
    size_t at = 0;
    for (int i = 0; i < 3; ++i) {  // name, type, parent
      uint32_t length;
      std::memcpy(&length, grid.data() + at, 4);
      at += 4 + length;
    }
    for (int i = 0; i < 3; ++i, at += 8) {
      int64_t offset;
      std::memcpy(&offset, grid.data() + at, 8);
      offset += by;
      std::memcpy(grid.data() + at, &offset, 8);
    }
    return grid;
  };
  const std::string first = a.substr(count_at + 4), second = b.substr(count_at + 4);
  return a.substr(0, count_at) + std::string("\2\0\0\0", 4) + first +
         shifted(second, static_cast<int64_t>(first.size()));
}

TEST_F(OpenVdb, GridsAreFoundByName) {
  const VolumeInfo density = make_info({3, 4, 5}, VoxelFormat::density8);
  const VolumeInfo color = make_info({6, 5, 4}, VoxelFormat::rgb24);
  ASSERT_TRUE(write_vdb("density.vdb", density, random_voxels(density)));
  ASSERT_TRUE(write_vdb("color.vdb", color, random_voxels(color)));
  put("both.vdb", joined(get(path("density.vdb")), get(path("color.vdb"))));
  Bytes first, named, alone;
  const auto unnamed = open_vdb(path("both.vdb"), {}, ctx_);
  ASSERT_FALSE(unnamed);
  EXPECT_EQ(unnamed.error().what,
            "2 grids: expected --grid NAME with one of density (Tree_float_5_4_3), color (Tree_vec3s_5_4_3)");
  const auto any = open_vdb(path("both.vdb"), with([&](OpenOptions& o) { o.any_part = true; }), ctx_);
  ASSERT_TRUE(any);
  EXPECT_EQ((*any)->info().parts.size(), 1u);
  ASSERT_TRUE(read_vdb("both.vdb", first, "density"));
  ASSERT_TRUE(read_vdb("density.vdb", alone));
  EXPECT_EQ(first, alone);
  ASSERT_TRUE(read_vdb("both.vdb", named, "color"));
  ASSERT_TRUE(read_vdb("color.vdb", alone));
  EXPECT_EQ(named, alone);

  const auto missing = open_vdb(path("both.vdb"), grid_named("fuel"), ctx_);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::input);
  EXPECT_NE(missing.error().what.find("density (Tree_float_5_4_3), color (Tree_vec3s_5_4_3)"),
            std::string::npos)
      << missing.error().what;

  // The first grid is of a type that is not read: the second is taken, or the first refused by name.
  put("int.vdb", replaced(get(path("both.vdb")), "Tree_float_5_4_3", "Tree_strng_5_4_3"));
  ASSERT_TRUE(read_vdb("int.vdb", named));
  EXPECT_EQ(named, alone);
  const auto refused = open_vdb(path("int.vdb"), grid_named("density"), ctx_);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().what.find("unsupported grid type Tree_strng_5_4_3"), std::string::npos);
  put("only.vdb", replaced(get(path("density.vdb")), "Tree_float_5_4_3", "Tree_strng_5_4_3"));
  expect_error(path("only.vdb"), "unsupported grid type");
}

/// A file by hand, not compressed: one leaf at the origin, all of whose voxels are active.
std::string by_hand(const std::string& type, const std::string& background, const std::string& values,
                    const std::string& map = "AffineMap", const std::vector<double>& matrix = {}) {
  std::string file;
  const auto put = [&](auto value) { file.append(reinterpret_cast<const char*>(&value), sizeof value); };
  const auto text = [&](const std::string& word) { put(static_cast<uint32_t>(word.size())), file += word; };
  put(int64_t{0x56444220}), put(uint32_t{224}), put(uint32_t{10}), put(uint32_t{0}), put(char{1});
  file += "00000000-0000-0000-0000-000000000000";
  put(uint32_t{0}), put(int32_t{1});
  text("g"), text("Tree_" + type + "_5_4_3"), text("");
  const size_t offsets = file.size();
  put(int64_t{0}), put(int64_t{0}), put(int64_t{0});
  const auto start = static_cast<int64_t>(file.size());
  put(uint32_t{0}), put(uint32_t{0}), text(map);  // no compression, no metadata
  for (int i = 0; i < 16; ++i)
    put(matrix.empty() ? (i % 5 == 0 ? 1.0 : 0.0) : matrix[static_cast<size_t>(i)]);
  put(int32_t{1});  // buffers
  file += background;
  put(uint32_t{0}), put(uint32_t{1}), put(int32_t{0}), put(int32_t{0}), put(int32_t{0});
  for (const size_t entries : {size_t{32768}, size_t{4096}}) {  // the first child of each
    file += '\1' + std::string(entries / 8 - 1, '\0') + std::string(entries / 8, '\0') + '\6';
    for (size_t i = 0; i < entries; ++i) file += background;
  }
  file += std::string(64, '\xff');
  file += std::string(64, '\xff') + (type == "bool" ? std::string(12, '\0') : std::string("\6", 1)) + values;
  const auto end = static_cast<int64_t>(file.size());
  file.replace(offsets, 8, reinterpret_cast<const char*>(&start), 8);
  file.replace(offsets + 8, 8, reinterpret_cast<const char*>(&end), 8);
  file.replace(offsets + 16, 8, reinterpret_cast<const char*>(&end), 8);
  return file;
}
/// Values of a leaf, z fastest: `of(x, y, z)`.
template <class Of>
std::string leaf_values(const Of& of) {
  std::string raw;
  for (int x = 0; x < 8; ++x)
    for (int y = 0; y < 8; ++y)
      for (int z = 0; z < 8; ++z) {
        const auto value = of(x, y, z);
        raw.append(reinterpret_cast<const char*>(&value), sizeof value);
      }
  return raw;
}

TEST_F(OpenVdb, BitsAndIntegersAreKept) {
  std::string bits(64, '\0');
  bits[static_cast<size_t>(3 * 8 + 2)] = 1 << 5;  // x 3, y 2, z 5
  put("a.vdb", by_hand("bool", std::string(1, '\0'), bits));
  Bytes back;
  auto source = read_vdb("a.vdb", back);
  ASSERT_TRUE(source);
  EXPECT_EQ(source->info().format, VoxelFormat::bitmap);
  EXPECT_EQ(source->info().dims, Index3(8, 8, 8));
  for (size_t i = 0; i < 512; ++i) ASSERT_EQ(back[i] != std::byte{0}, i == (5 * 8 + 2) * 8 + 3) << i;

  put("a.vdb",
      by_hand("int32", std::string(4, '\0'), leaf_values([](int x, int, int z) { return 1000000 * z - x; })));
  source = read_vdb("a.vdb", back);
  ASSERT_TRUE(source);
  EXPECT_EQ(source->info().sample_type, SampleType::i32);
  EXPECT_EQ(source->info().sample(static_cast<double>(back[3])), -3);
  EXPECT_EQ(source->info().sample(static_cast<double>(back[7 * 64 + 3])), 6999997);
  put("a.vdb", by_hand("int64", std::string(8, '\0'),
                       leaf_values([](int x, int, int) { return (int64_t{1} << 60) + x; })));
  source = read_vdb("a.vdb", back);
  ASSERT_TRUE(source);
  EXPECT_EQ((*source->info().labels)[1], int64_t{1} << 60);
  EXPECT_EQ(back[2], std::byte{3});
}

TEST_F(OpenVdb, DoublesAreRoundedAndSaidAndVectorsAreColors) {
  std::string notes;
  ctx_.note = [&](const std::string& line) { notes += line; };
  put("a.vdb",
      by_hand("double", std::string(8, '\0'), leaf_values([](int x, int, int) { return x / 10.0; })));
  Bytes back;
  auto source = read_vdb("a.vdb", back);
  ASSERT_TRUE(source);
  EXPECT_EQ(floats_of(back)[3], 0.3f);
  EXPECT_TRUE(source->info().rounded);
  EXPECT_NE(notes.find("rounded to 32 bits"), std::string::npos);
  notes.clear();
  put("a.vdb", by_hand("vec3i", std::string(12, '\0'), leaf_values([](int x, int y, int) {
                         return std::array<int, 3>{x, 255, y};
                       })));
  ASSERT_TRUE(read_vdb("a.vdb", back));
  EXPECT_EQ(back[4 * (8 * 2 + 3)], std::byte{3});
  EXPECT_EQ(back[4 * (8 * 2 + 3) + 1], std::byte{255});
  EXPECT_EQ(back[4 * (8 * 2 + 3) + 2], std::byte{2});
  EXPECT_EQ(notes, "");
  put("a.vdb", by_hand("vec3s", std::string(12, '\0'), leaf_values([](int x, int, int) {
                         return std::array<float, 3>{-1, 0, static_cast<float>(x)};
                       })));
  ASSERT_TRUE(read_vdb("a.vdb", back));
  EXPECT_NE(notes.find("vectors outside of 0..1"), std::string::npos) << notes;
}

TEST_F(OpenVdb, TransformsAreAffinesAndOthersAreRefused) {
  const std::string values = leaf_values([](int x, int, int) { return static_cast<float>(x); });
  put("a.vdb", by_hand("float", std::string(4, '\0'), values, "AffineMap",
                       {0, 0.5, 0, 0, -2, 0, 0, 0, 0.1, 0.2, 3, 0, 7, 8, 9, 1}));
  Bytes back;
  const auto source = read_vdb("a.vdb", back);
  ASSERT_TRUE(source);
  EXPECT_EQ(source->info().affine.axes[0], (Affine::Vector{0, 0.5, 0}));
  EXPECT_EQ(source->info().affine.axes[1], (Affine::Vector{-2, 0, 0}));
  EXPECT_EQ(source->info().affine.axes[2], (Affine::Vector{0.1, 0.2, 3}));
  EXPECT_EQ(source->info().affine.origin, (Affine::Vector{7, 8, 9}));
  expect_error(put("a.vdb", by_hand("float", std::string(4, '\0'), values, "NonlinearFrustumMap")),
               "grid g has the transform NonlinearFrustumMap: expected a linear one");
  for (const char* type : {"ptdataidx32", "string", "mask"})
    expect_error(put("a.vdb", by_hand(type, std::string(4, '\0'), values)), "unsupported grid type");
}

TEST_F(OpenVdb, PlacesComeBackToTheLastBit) {
  VolumeInfo info = make_info({9, 3, 2}, VoxelFormat::float32, SampleType::f32);
  info.world = World::lps;
  info.unit = Unit::micrometre;
  info.description = "a scan";
  info.slope = 0.1, info.intercept = -1.0 / 3;
  const Bytes voxels = random_voxels(info);
  std::vector<Affine> affines{Affine::plain({0.1, 0.1, 0.1}, {1000.7, -0.3, 1e-9}),
                              Affine::plain({0.1, 1.0 / 3, 2.6755}, {1e6 / 7, 0, -5})};
  affines.push_back(affines[1]);
  affines[2].axes[0][0] = -0.1;
  affines.push_back(affines[1]);
  affines[3].axes = {{{0.1, 0.7, -0.2}, {0.3, -0.1, 1.0 / 3}, {0.9, 0.1, 0.7}}};
  for (const Affine& affine : affines) {
    info.affine = affine;
    ASSERT_TRUE(write_vdb("a.vdb", info, voxels));
    Bytes back;
    const auto source = read_vdb("a.vdb", back);
    ASSERT_TRUE(source);
    EXPECT_EQ(source->info().affine, affine);
    EXPECT_EQ(source->info().world, info.world);
    EXPECT_EQ(source->info().unit, info.unit);
    EXPECT_EQ(source->info().description, info.description);
    EXPECT_EQ(source->info().slope, info.slope);
    EXPECT_EQ(source->info().intercept, info.intercept);
    EXPECT_EQ(back, voxels);
  }
}

TEST_F(OpenVdb, WideIntegersAndHalfsStayWhatTheyAre) {
  VolumeInfo info = make_info({3, 1, 1}, VoxelFormat::density8, SampleType::u32);
  info.labels = std::make_shared<std::vector<int64_t>>(std::vector<int64_t>{0, 7, 4000000000});
  const Bytes voxels{std::byte{2}, std::byte{0}, std::byte{1}};
  ASSERT_TRUE(write_vdb("a.vdb", info, voxels));
  Bytes back;
  auto source = read_vdb("a.vdb", back);
  ASSERT_TRUE(source);
  EXPECT_EQ(source->info().sample_type, SampleType::i64);
  EXPECT_EQ(*source->info().labels, *info.labels);
  EXPECT_EQ(back, voxels);
  info = make_info({2, 1, 1}, VoxelFormat::float32, SampleType::f16);
  for (const float second : {-5.0f, 0.1f}) {
    ASSERT_TRUE(write_vdb("a.vdb", info, bytes_of({1.5f, second})));
    source = read_vdb("a.vdb", back);
    ASSERT_TRUE(source);
    EXPECT_EQ(source->info().sample_type, second == 0.1f ? SampleType::f32 : SampleType::f16);
    EXPECT_EQ(floats_of(back), (std::vector<float>{1.5f, second}));
  }
}

TEST_F(OpenVdb, FilesOfOthersSpanTheirActiveVoxels) {
  VolumeInfo info = make_info({30, 20, 10}, VoxelFormat::float32, SampleType::f32);
  info.affine = Affine::plain({2, 2, 2}, info.affine.origin);
  std::vector<float> values(30 * 20 * 10);
  const auto at = [&](int x, int y, int z) -> float& {
    return values[static_cast<size_t>((z * 20 + y) * 30 + x)];
  };
  at(3, 4, 5) = 1;
  at(12, 13, 7) = 2;
  ASSERT_TRUE(write_vdb("a.vdb", info, bytes_of(values)));
  put("b.vdb", replaced(get(path("a.vdb")), "voxkit_dims", "somebody_is"));
  Bytes back;
  const auto source = read_vdb("b.vdb", back);
  ASSERT_TRUE(source);
  EXPECT_EQ(source->info().dims, Index3(10, 10, 3));
  EXPECT_EQ(source->info().affine.origin, (std::array<double, 3>{6, 8, 10}));
  EXPECT_EQ(floats_of(back).front(), 1);
  EXPECT_EQ(floats_of(back).back(), 2);
  EXPECT_EQ(std::count(back.begin(), back.end(), std::byte{0}), 10 * 10 * 3 * 4 - 3);

  ASSERT_TRUE(write_vdb("a.vdb", info, Bytes(values.size() * 4)));
  ASSERT_TRUE(read_vdb("a.vdb", back));
  EXPECT_EQ(back, Bytes(values.size() * 4));
  put("b.vdb", replaced(get(path("a.vdb")), "voxkit_dims", "somebody_is"));
  expect_error(path("b.vdb"), "is empty");
}

TEST_F(OpenVdb, DamagedFilesAreRefused) {
  const VolumeInfo info = make_info({9, 3, 2}, VoxelFormat::float32, SampleType::f32);
  ASSERT_TRUE(write_vdb("a.vdb", info, random_voxels(info)));
  const std::string valid = get(path("a.vdb"));
  // Cuts and changes where the structure is: before the masks and values, which are most of the file.
  for (size_t length = 0; length < valid.size(); length += length < 1200 ? 1 : 37) {
    const Status status = try_file(put("cut.vdb", valid.substr(0, length)));
    ASSERT_FALSE(status) << "accepted a file cut to " << length << " of " << valid.size() << " bytes";
    ASSERT_EQ(status.error().code, ErrorCode::input) << status.error().what;
  }
  for (int i = 0; i < 1500; ++i) {
    std::string changed = valid;
    for (auto n = 1 + random_() % 3; n > 0; --n)
      changed[random_() % (i % 2 ? changed.size() : 1200)] = static_cast<char>(random_());
    const Status status = try_file(put("changed.vdb", changed));
    ASSERT_TRUE(status || status.error().code == ErrorCode::input) << status.error().what;
  }
  // A count of grids, and a length of a name, that no file can hold.
  std::string huge = valid;
  huge.replace(21 + 36 + 4 + 4, 4, "\xff\xff\xff\x7f");
  expect_error(put("huge.vdb", huge), "leads past its end");
}

TEST_F(OpenVdb, MemoryIsLimited) {
  const VolumeInfo info = make_info({40, 40, 40}, VoxelFormat::float32, SampleType::f32);
  const Bytes voxels = random_voxels(info);
  ASSERT_TRUE(write_vdb("a.vdb", info, voxels));
  MemoryBudget little(100000);
  ctx_.memory = &little;
  const auto source = open_vdb(path("a.vdb"), {}, ctx_);
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().code, ErrorCode::limit);
  const Status written = write_vdb("b.vdb", info, voxels);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::limit);
  EXPECT_FALSE(std::filesystem::exists(path("b.vdb")));
  // Everything reserved was given back.
  EXPECT_TRUE(little.reserve(100000, "all"));
}

TEST_F(OpenVdb, ExistingFilesAreKeptWithoutForce) {
  const VolumeInfo info = make_info({2, 2, 2}, VoxelFormat::density8);
  put("a.vdb", "precious");
  const auto sink = create_vdb(path("a.vdb"), info, false, ctx_);
  ASSERT_FALSE(sink);
  EXPECT_EQ(sink.error().code, ErrorCode::output);
  EXPECT_EQ(get(path("a.vdb")), "precious");
}

class Modules : public FileFormatTest {};

TEST_F(Modules, MissingOnesNameThePackage) {
  const auto missing = load_module(folder_, {"openvdb", "reading .vdb files", "libopenvdb-dev"});
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::input);
  EXPECT_EQ(missing.error().what,
            "reading .vdb files needs the openvdb module: install libopenvdb-dev and rebuild");
  const auto for_writing =
      load_module(folder_, {"openvdb", "writing .vdb files", "libopenvdb-dev", ErrorCode::usage});
  ASSERT_FALSE(for_writing);
  EXPECT_EQ(for_writing.error().code, ErrorCode::usage);
}

TEST_F(Modules, OthersThanOursAreRefused) {
  put("openvdb.so", "not a library");
  const auto broken = load_module(folder_, {"openvdb", "reading .vdb files", "libopenvdb-dev"});
  ASSERT_FALSE(broken);
  EXPECT_NE(broken.error().what.find("cannot be loaded"), std::string::npos);
  EXPECT_EQ(broken.error().what.find('\n'), std::string::npos);
}

}  // namespace
}  // namespace voxkit
