#include <cmath>

#include "formats/copy.h"
#include "formats/volume/dense_source.h"
#include "tests/formats/file_format_test.h"

namespace voxkit {
namespace {

class RawTest : public FileFormatTest {
 protected:
  static OpenOptions options(Index3 dims, const std::string& type, bool big_endian = false) {
    OpenOptions o;
    o.dims = dims;
    o.type = type;
    o.big_endian = big_endian;
    return o;
  }
  /// Samples of T, in both byte orders, become `expected` voxels.
  template <class T, class V>
  void expect_voxels(const std::string& type, const std::vector<T>& samples, const std::vector<V>& expected) {
    for (bool big : {false, true}) {
      SCOPED_TRACE(type + (big ? " big" : " little"));
      const std::string file = put("v.raw", sample_text(samples, big));
      auto source = open_raw(file, options({static_cast<int64_t>(samples.size()), 1, 1}, type, big), ctx_);
      ASSERT_TRUE(source) << source.error().what;
      const auto voxels = read(**source);
      ASSERT_TRUE(voxels);
      ASSERT_EQ(voxels->size(), expected.size() * sizeof(V));
      EXPECT_EQ(std::memcmp(voxels->data(), expected.data(), voxels->size()), 0);
    }
  }
};

TEST_F(RawTest, EveryTypeBecomesTheVoxelsItShould) {
  expect_voxels<uint8_t, uint8_t>("u8", {0, 1, 255}, {0, 1, 255});
  expect_voxels<int8_t, uint8_t>("i8", {-128, -1, 0, 127}, {0, 127, 128, 255});
  expect_voxels<uint16_t, uint16_t>("u16", {0, 258, 65535}, {0, 258, 65535});
  expect_voxels<int16_t, uint16_t>("i16", {-32768, -1, 0, 32767}, {0, 32767, 32768, 65535});
  expect_voxels<uint32_t, uint8_t>("u32", {4294967295u, 0, 16777217, 0}, {2, 0, 1, 0});
  expect_voxels<int32_t, uint16_t>("i32", {-2147483647, -2147483000, -2147483647}, {0, 647, 0});
  expect_voxels<float, float>("f32", {-1.5f, 3e38f, INFINITY}, {-1.5f, 3e38f, INFINITY});
  expect_voxels<double, float>("f64", {-1.5, 0.1, 1e300}, {-1.5f, 0.1f, INFINITY});
}

/// Integers of more than 16 bits come back as they were: by a base, by a table, or as floats that hold them.
TEST_F(RawTest, WideIntegersAreExact) {
  const auto round_trip = [&]<class T>(const char* type, const std::vector<T>& values, VoxelFormat expected) {
    for (const bool big : {false, true}) {
      put("wide.raw", sample_text<T>(values, big));
      OpenOptions options;
      options.dims = Index3(static_cast<int64_t>(values.size()), 1, 1);
      options.type = type;
      options.big_endian = big;
      auto source = open_volume(path("wide.raw"), options, ctx_);
      ASSERT_TRUE(source) << source.error().what;
      const VolumeInfo info = (*source)->info();
      EXPECT_EQ(info.format, expected) << type;
      auto sink = create_volume(path("back.raw"), info, true, ctx_);
      ASSERT_TRUE(sink);
      ASSERT_TRUE(copy_volume(**source, info.box(), **sink, ctx_));
      ASSERT_TRUE((*sink)->finish());
      EXPECT_EQ(get(path("back.raw")), sample_text<T>(values, false)) << type;
    }
  };
  round_trip("u32", std::vector<uint32_t>{4000000000u, 4000000255u, 4000000001u}, VoxelFormat::density8);
  round_trip("i32", std::vector<int32_t>{-2147483647 - 1, -2147480000}, VoxelFormat::density16);
  round_trip("i32", std::vector<int32_t>{-2147483647 - 1, 2147483647, 0, 5}, VoxelFormat::density8);
  round_trip("u64", std::vector<uint64_t>{UINT64_MAX, 1, 0x8000000000000000u, 1}, VoxelFormat::density8);
  round_trip("i64", std::vector<int64_t>{INT64_MIN, INT64_MAX, -1}, VoxelFormat::density8);
  std::vector<uint32_t> many;
  for (uint32_t i = 0; i < 65536; ++i) many.push_back(i * 65000u);
  round_trip("u32", many, VoxelFormat::density16);
  many.assign(1, 0);
  for (uint32_t i = 0; i < 70000; ++i) many.push_back(i * 200u);
  round_trip("u32", many, VoxelFormat::float32);
}

TEST_F(RawTest, WideIntegersThatNoFormatHoldsAreRefused) {
  std::vector<uint32_t> values;
  for (uint32_t i = 0; i < 65537; ++i) values.push_back(i * 65001u);
  put("wide.raw", sample_text<uint32_t>(values, false));
  OpenOptions options;
  options.dims = Index3(65537, 1, 1);
  options.type = "u32";
  const auto refused = open_volume(path("wide.raw"), options, ctx_);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::input);
  EXPECT_NE(refused.error().what.find("--type f32"), std::string::npos) << refused.error().what;
  options.round_wide = true;
  const auto rounded = open_volume(path("wide.raw"), options, ctx_);
  ASSERT_TRUE(rounded);
  EXPECT_TRUE((*rounded)->info().rounded);
  float last = 0;
  ASSERT_TRUE((*rounded)->read({{65536, 0, 0}, {65537, 1, 1}}, {reinterpret_cast<std::byte*>(&last), 0, 0}));
  EXPECT_EQ(last, static_cast<float>(65536u * 65001u));
}

TEST_F(RawTest, DoublesSayWhenTheyAreRounded) {
  OpenOptions options;
  options.dims = Index3(2, 1, 1);
  options.type = "f64";
  for (const bool exact : {true, false}) {
    put("double.raw", sample_text<double>({0.5, exact ? 0.25 : 0.1}, false));
    std::string said;
    ctx_.note = [&](const std::string& line) { said += line; };
    const auto source = open_volume(path("double.raw"), options, ctx_);
    ASSERT_TRUE(source);
    EXPECT_EQ((*source)->info().rounded, !exact);
    EXPECT_EQ(said.empty(), exact) << said;
  }
}

TEST_F(RawTest, HalfFloatsAreFloats) {
  expect_voxels<uint16_t, float>("f16", {0x3c00, 0x0001, 0xfc00}, {1, 0x1p-24f, -INFINITY});
}

TEST_F(RawTest, BitsArePackedWithoutGapsLowestFirst) {
  const Index3 dims{5, 3, 7};
  std::string text;
  for (int i = 0; i < 14; ++i) text += static_cast<char>(random_());
  auto source = open_raw(put("v.raw", text), options(dims, "bit"), ctx_);
  ASSERT_TRUE(source) << source.error().what;
  const Bytes voxels = *read(**source);
  for (size_t i = 0; i < voxels.size(); ++i)
    ASSERT_EQ(std::to_integer<int>(voxels[i]), static_cast<unsigned char>(text[i / 8]) >> (i % 8) & 1) << i;
}

TEST_F(RawTest, BoxesAreCutOutOfTheVolume) {
  for (const std::string type : {"u8", "i16", "f64", "rgb8", "rgba8", "bit"}) {
    SCOPED_TRACE(type);
    const Index3 dims{13, 7, 9};
    const int bits = type == "bit"    ? 1
                     : type == "i16"  ? 16
                     : type == "f64"  ? 64
                     : type == "rgb8" ? 24
                     : type == "u8"   ? 8
                                      : 32;
    std::string text(static_cast<size_t>((dims.x * dims.y * dims.z * bits + 7) / 8), '\0');
    for (char& c : text) c = static_cast<char>(random_() & 0x3f);
    auto source = open_raw(put("v.raw", text), options(dims, type), ctx_);
    ASSERT_TRUE(source) << source.error().what;
    const VoxelFormat format = (*source)->info().format;
    const int bytes = voxel_bytes(format);
    const Bytes all = *read(**source);
    for (int i = 0; i < 200; ++i) {
      Box box;
      for (int a = 0; a < 3; ++a) {
        box.lo[a] = static_cast<int64_t>(random_()) % dims[a];
        box.hi[a] = box.lo[a] + 1 + static_cast<int64_t>(random_()) % (dims[a] - box.lo[a]);
        if (i % 3 == 0 && a < 2) box.lo[a] = 0, box.hi[a] = dims[a];
      }
      const Index3 size = box.size();
      const int64_t row = size.x * bytes + i % 2, slice = row * size.y + i % 5;
      Bytes out(static_cast<size_t>(slice * size.z), std::byte{0xee});
      ASSERT_TRUE((*source)->read(box, {out.data(), row, slice}));
      for (int64_t z = 0; z < size.z; ++z)
        for (int64_t y = 0; y < size.y; ++y) {
          const int64_t at = ((box.lo.z + z) * dims.y + box.lo.y + y) * dims.x + box.lo.x;
          ASSERT_EQ(std::memcmp(out.data() + y * row + z * slice, all.data() + at * bytes,
                                static_cast<size_t>(size.x * bytes)),
                    0);
        }
    }
    EXPECT_EQ((*source)->read({{0, 0, 0}, {14, 1, 1}}, {}).error().code, ErrorCode::internal);
  }
}

TEST_F(RawTest, WhatIsWrittenReadsBack) {
  for (const Index3 dims : {Index3{1, 1, 1}, Index3{7, 5, 3}, Index3{64, 1, 2}, Index3{1, 31, 17}}) {
    round_trip("v.raw", make_info(dims, VoxelFormat::density8), options(dims, "u8"));
    round_trip("v.raw", make_info(dims, VoxelFormat::density8, SampleType::i8), options(dims, "i8"));
    round_trip("v.raw", make_info(dims, VoxelFormat::density16, SampleType::u16), options(dims, "u16"));
    round_trip("v.raw", make_info(dims, VoxelFormat::density16, SampleType::i16), options(dims, "i16"));
    round_trip("v.raw", make_info(dims, VoxelFormat::float32, SampleType::f64), options(dims, "f32"));
    round_trip("v.raw", make_info(dims, VoxelFormat::rgb24), options(dims, "rgb8"));
    round_trip("v.raw", make_info(dims, VoxelFormat::rgba32), options(dims, "rgba8"));
    round_trip("v.raw", make_info(dims, VoxelFormat::bitmap, SampleType::bit), options(dims, "bit"));
    EXPECT_EQ(get(path("v.raw")).size(), static_cast<size_t>((dims.x * dims.y * dims.z + 7) / 8));
  }
}

TEST_F(RawTest, IntegersOfManyBitsAndHalvesAreWrittenAsSuch) {
  const Index3 dims{2, 1, 1};
  VolumeInfo info = make_info(dims, VoxelFormat::density8, SampleType::u64);
  info.labels = std::make_shared<std::vector<int64_t>>(std::vector<int64_t>{7, -1});
  auto sink = create_volume(path("v.raw"), info, true, ctx_);
  ASSERT_TRUE(sink && write(**sink, info, {std::byte{1}, std::byte{0}}));
  EXPECT_EQ(get(path("v.raw")), sample_text<uint64_t>({UINT64_MAX, 7}, false));
  auto source = open_raw(path("v.raw"), options(dims, "u64"), ctx_);
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ(*(*source)->info().labels, *info.labels);
  put("h.raw", sample_text<uint16_t>({0x3c01, 0xfc00}, false));
  source = open_raw(path("h.raw"), options(dims, "f16"), ctx_);
  ASSERT_TRUE(source);
  info = (*source)->info();
  EXPECT_EQ(info.sample_type, SampleType::f16);
  sink = create_volume(path("v.raw"), info, true, ctx_);
  ASSERT_TRUE(sink && write(**sink, info, *read(**source)));
  EXPECT_EQ(get(path("v.raw")), get(path("h.raw")));
  EXPECT_TRUE(notes_.empty()) << all_notes();
}

TEST_F(RawTest, WhatARawFileCannotHoldIsNamed) {
  VolumeInfo info = make_info({2, 3, 4}, VoxelFormat::density16, SampleType::i16);
  info.affine = Affine::plain({1, 1, 2}, {0, 0, 0});
  info.unit = Unit::millimetre;
  info.world = World::lps;
  info.slope = 0.5;
  info.is_labels = true;
  info.fill = 32769;
  info.description = "a head";
  ASSERT_TRUE(create_volume(path("v.raw"), info, true, ctx_));
  EXPECT_TRUE(noted(
      "a raw file has samples only, here for --dims 2,3,4 --type i16: where the volume is, the world LPS, "
      "the "
      "unit mm, the slope 0.5 and the intercept 0, that values are labels, that 1 is the fill value and the "
      "description dropped"))
      << all_notes();
  EXPECT_EQ(notes_.size(), 1u);
}

TEST_F(RawTest, ThereIsOneVolumeInIt) {
  OpenOptions o = options({1, 1, 1}, "u8");
  o.time = 0;
  EXPECT_TRUE(open_raw(put("v.raw", "x"), o, ctx_));
  o.time = 1;
  EXPECT_EQ(open_raw(path("v.raw"), o, ctx_).error().what, "--time 1: the file has 1 time step: expected 0");
}

TEST_F(RawTest, ValuesAreLabelsWhereAUserSaysSo) {
  for (const bool labels : {false, true}) {
    OpenOptions o = options({1, 1, 1}, "u8");
    o.labels = labels;
    EXPECT_EQ((*open_volume(put("v.raw", "x"), o, ctx_))->info().is_labels, labels);
  }
}

TEST_F(RawTest, WhatTheInputConsistsOfIsNotWritten) {
  OpenOptions o = options({1, 1, 1}, "u8");
  put("slice-7.raw", "x");
  for (const std::string& name :
       {path("slice-7.raw"), path("./slice-7.raw"), path("slice-%d.raw"), path("slice-%01d.raw")}) {
    o.outputs = {path("other"), name};
    const auto source = open_volume(path("slice-7.raw"), o, ctx_);
    ASSERT_FALSE(source) << name;
    EXPECT_EQ(source.error().code, ErrorCode::usage);
    EXPECT_NE(source.error().what.find("is part of the input as well"), std::string::npos);
  }
  o.outputs = {path("other"), "-", path("slice-%d.tif")};
  EXPECT_TRUE(open_volume(path("slice-7.raw"), o, ctx_));
  EXPECT_EQ(files_of_output("a/b.nhdr"), (std::vector<std::string>{"a/b.nhdr", "a/b.raw"}));
  EXPECT_EQ(files_of_output("a/b.nrrd"), (std::vector<std::string>{"a/b.nrrd"}));
}

TEST_F(RawTest, SizesMustAgree) {
  const std::string file = put("v.raw", std::string(23, 'x'));
  const auto source = open_raw(file, options({2, 3, 4}, "u8"), ctx_);
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().code, ErrorCode::input);
  EXPECT_NE(source.error().what.find("is 23 bytes long: expected 24"), std::string::npos)
      << source.error().what;
  EXPECT_FALSE(open_raw(file, options({11, 2, 1}, "u8"), ctx_));
  EXPECT_FALSE(open_raw(put("empty.raw", ""), options({1, 1, 1}, "u8"), ctx_));
}

TEST_F(RawTest, WhatTheUserMustSayIsAskedFor) {
  const std::string file = put("v.raw", "x");
  EXPECT_EQ(open_raw(file, {}, ctx_).error().code, ErrorCode::usage);
  OpenOptions o;
  o.dims = Index3{1, 1, 1};
  EXPECT_NE(open_raw(file, o, ctx_).error().what.find("--type is missing"), std::string::npos);
  EXPECT_EQ(open_raw(file, options({1, 1, 1}, "u7"), ctx_).error().code, ErrorCode::usage);
  for (const Index3 dims :
       {Index3{0, 1, 1}, Index3{-1, 1, 1}, Index3{max_side + 1, 1, 1}, Index3{max_side, max_side, 2}})
    EXPECT_EQ(open_raw(file, options(dims, "u8"), ctx_).error().code, ErrorCode::usage);
  EXPECT_EQ(open_raw(file, options({max_side, max_side, 1}, "f64"), ctx_).error().code, ErrorCode::usage);
}

TEST_F(RawTest, NamesDecideTheKind) {
  EXPECT_EQ(open_volume(path("missing.nrrd"), {}, ctx_).error().what, "No such file or directory");
  EXPECT_EQ(open_volume(put("v.xyz", "x"), {}, ctx_).error().code, ErrorCode::input);
  EXPECT_EQ(
      create_volume(path("v.xyz"), make_info({1, 1, 1}, VoxelFormat::density8), false, ctx_).error().code,
      ErrorCode::usage);
  EXPECT_TRUE(open_volume(put("V.RAW", "x"), options({1, 1, 1}, "u8"), ctx_));
  EXPECT_TRUE(open_volume("sphere:5", {}, ctx_));
}

TEST_F(RawTest, SlabsMustComeInOrderAndAll) {
  const VolumeInfo info = make_info({2, 2, 3}, VoxelFormat::density8);
  const Bytes voxels = random_voxels(info);
  const ConstVoxelSpan span = packed(voxels.data(), info.dims, info.format);
  auto sink = create_volume(path("v.raw"), info, false, ctx_);
  ASSERT_TRUE(sink);
  EXPECT_EQ((*sink)->write(1, 2, span).error().code, ErrorCode::internal);
  ASSERT_TRUE((*sink)->write(0, 2, span));
  EXPECT_EQ((*sink)->write(2, 4, span).error().code, ErrorCode::internal);
  EXPECT_EQ((*sink)->finish().error().code, ErrorCode::internal);
  sink->reset();
  EXPECT_FALSE(std::filesystem::exists(path("v.raw")));
}

}  // namespace
}  // namespace voxkit
