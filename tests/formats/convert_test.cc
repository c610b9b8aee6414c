#include "formats/convert.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "formats/copy.h"
#include "tests/memory_volume.h"

namespace voxkit {
namespace {

using test::color_info;
using test::FlatSource;
using test::ForwardSource;
using test::read_all;
using test::scalar_info;
using test::volume;

class ConvertTest : public testing::Test {
 protected:
  template <class Out, class In>
  std::vector<Out> converted(const VolumeInfo& info, const std::vector<In>& values, const char* type,
                             ValueRange range = {}) {
    auto source = convert_type(volume(info, values), *parse_target_type(type), range, ctx_);
    if (!source) return {};
    last_ = (*source)->info();
    return read_all<Out>(**source);
  }
  MemoryBudget memory_{1 << 24};
  Context ctx_{.threads = 2, .memory = &memory_};
  VolumeInfo last_;
};

using Bytes = std::vector<uint8_t>;
using Shorts = std::vector<uint16_t>;
using Floats = std::vector<float>;

TEST_F(ConvertTest, CropMatchesAPlainLoop) {
  const Index3 dims(23, 17, 11);
  Shorts values(static_cast<size_t>(dims.x * dims.y * dims.z));
  std::iota(values.begin(), values.end(), uint16_t{0});
  VolumeInfo info = scalar_info(dims, SampleType::u16);
  info.affine = Affine::plain({1, 2, 3}, info.affine.origin);
  info.affine.origin = {10, 20, 30};
  for (const Box& box :
       {Box{{1, 2, 3}, {22, 17, 9}}, Box{{0, 0, 4}, {23, 17, 5}}, Box{{22, 16, 10}, {23, 17, 11}}}) {
    Shorts expected;
    for (int64_t z = box.lo.z; z < box.hi.z; ++z)
      for (int64_t y = box.lo.y; y < box.hi.y; ++y)
        for (int64_t x = box.lo.x; x < box.hi.x; ++x)
          expected.push_back(values[static_cast<size_t>((z * dims.y + y) * dims.x + x)]);
    auto cropped = crop(volume(info, values), box, ctx_);
    ASSERT_TRUE(cropped);
    EXPECT_EQ(read_all<uint16_t>(**cropped), expected);
    EXPECT_EQ(read_all<uint16_t>(**cropped, {4, 3, 2}), expected);
    EXPECT_EQ((*cropped)->info().affine.origin[2], 30 + 3.0 * static_cast<double>(box.lo.z));
    auto forward = crop(std::make_unique<ForwardSource>(info, test::bytes_of(values)), box, ctx_);
    ASSERT_TRUE(forward);
    EXPECT_EQ(read_all<uint16_t>(**forward, {100, 100, 2}), expected);
  }
}

TEST_F(ConvertTest, CropRefusesBoxesOutside) {
  for (const Box& box : {Box{{0, 0, 0}, {4, 2, 2}}, Box{{-1, 0, 0}, {2, 2, 2}}, Box{{1, 1, 1}, {1, 2, 2}}}) {
    const auto cropped = crop(volume(scalar_info({3, 2, 2}, SampleType::u8), Bytes(12)), box, ctx_);
    ASSERT_FALSE(cropped);
    EXPECT_EQ(cropped.error().code, ErrorCode::usage);
  }
}

TEST_F(ConvertTest, WideningKeepsSampleValues) {
  const VolumeInfo bytes = scalar_info({3, 1, 1}, SampleType::u8),
                   chars = scalar_info({3, 1, 1}, SampleType::i8);
  EXPECT_EQ((converted<uint16_t>(bytes, Bytes{0, 7, 255}, "u16")), (Shorts{0, 7, 255}));
  EXPECT_EQ((converted<uint16_t>(chars, Bytes{0, 128, 255}, "i16")), (Shorts{32640, 32768, 32895}));
  EXPECT_EQ((converted<float>(chars, Bytes{0, 128, 255}, "f32")), (Floats{-128, 0, 127}));
  EXPECT_EQ(last_.sample_type, SampleType::f32);
  EXPECT_EQ((converted<uint16_t>(bytes, Bytes{0, 7, 255}, "i16")), (Shorts{32768, 32775, 33023}));
}

TEST_F(ConvertTest, NarrowingKeepsWhatFits) {
  const VolumeInfo info = scalar_info({3, 1, 1}, SampleType::i16);  // samples 0, 100, 255
  EXPECT_TRUE(needs_range(info, *parse_target_type("u8")));
  EXPECT_EQ((converted<uint8_t>(info, Shorts{32768, 32868, 33023}, "u8", {32768, 33023})),
            (Bytes{0, 100, 255}));
  EXPECT_EQ(last_.slope, 1);
  EXPECT_EQ((converted<uint8_t>(info, Shorts{32768, 32868, 32895}, "i8", {32768, 32895})),
            (Bytes{128, 228, 255}));
}

TEST_F(ConvertTest, NarrowingStretchesTheRangeAndKeepsRealValues) {
  std::mt19937 random(5);
  for (const auto& [type, greatest] : {std::pair{"u8", 255}, std::pair{"i8", 127}}) {
    VolumeInfo info = scalar_info({1000, 1, 1}, SampleType::i16);
    info.slope = 0.5;
    info.intercept = -3;
    const int lo = 31000, hi = 34000;
    Shorts values{uint16_t(lo), uint16_t(hi)};
    while (values.size() < 1000)
      values.push_back(static_cast<uint16_t>(lo + static_cast<int>(random() % 3001)));
    const Bytes out = converted<uint8_t>(info, values, type, {lo, hi});
    ASSERT_EQ(out.size(), 1000u);
    EXPECT_EQ(out[0], 0);
    EXPECT_EQ(out[1], 255);
    const auto bias = static_cast<int>(last_.bias());
    EXPECT_EQ(255 - bias, greatest);
    for (size_t i = 0; i < 1000; ++i) {
      // Nearest integer, halves up: floor((2 (v - lo) 255 + d) / 2d).
      const int d = hi - lo;
      ASSERT_EQ(out[i], (2 * (values[i] - lo) * 255 + d) / (2 * d));
      const double real = 0.5 * (values[i] - 32768) - 3;
      ASSERT_NEAR(last_.slope * (out[i] - bias) + last_.intercept, real, last_.slope / 2 + 1e-9);
    }
  }
}

TEST_F(ConvertTest, FloatsStretchAndNanGoesLow) {
  const float nan = std::nanf(""), inf = std::numeric_limits<float>::infinity();
  const VolumeInfo info = scalar_info({6, 1, 1}, SampleType::f32);
  EXPECT_EQ((converted<uint8_t>(info, Floats{0, 1, 0.5f, nan, inf, -inf}, "u8", {0, 1})),
            (Bytes{0, 255, 128, 0, 255, 0}));
  EXPECT_DOUBLE_EQ(last_.slope, 1 / 255.0);
  EXPECT_EQ((converted<uint16_t>(info, Floats{0, 1, 0.5f, nan, inf, -inf}, "i16", {0, 1})),
            (Shorts{0, 65535, 32768, 0, 65535, 0}));
  // A flat volume keeps its real value.
  EXPECT_EQ((converted<uint8_t>(info, Floats(6, 4.25f), "u8", {4.25, 4.25})), Bytes(6, 0));
  EXPECT_EQ(last_.intercept, 4.25);
  for (const ValueRange range : {ValueRange{1, 0}, ValueRange{0, HUGE_VAL}, ValueRange{std::nan(""), 1}})
    EXPECT_TRUE((converted<uint8_t>(info, Floats(6), "u8", range)).empty());
}

TEST_F(ConvertTest, Colors) {
  const VolumeInfo scalar = scalar_info({2, 1, 1}, SampleType::u8);
  EXPECT_EQ((converted<uint8_t>(scalar, Bytes{0, 200}, "rgba8")), (Bytes{0, 0, 0, 0, 200, 200, 200, 200}));
  EXPECT_EQ((converted<uint8_t>(scalar_info({2, 1, 1}, SampleType::bit), Bytes{0, 1}, "rgba8")),
            (Bytes{0, 0, 0, 0, 255, 255, 255, 255}));
  EXPECT_EQ((converted<uint8_t>(color_info({1, 1, 1}, VoxelFormat::rgb24), Bytes{1, 2, 3}, "rgba8")),
            (Bytes{1, 2, 3, 255}));
  std::mt19937 random(9);
  Bytes rgba(4000);
  for (uint8_t& v : rgba) v = static_cast<uint8_t>(random());
  const Bytes gray = converted<uint8_t>(color_info({1000, 1, 1}, VoxelFormat::rgba32), rgba, "u8");
  const Bytes gray_rgb = converted<uint8_t>(color_info({1333, 1, 1}, VoxelFormat::rgb24), rgba, "u8");
  ASSERT_EQ(gray.size(), 1000u);
  for (size_t i = 0; i < 1000; ++i) {
    const auto luma = [&](size_t at) {
      return 0.2126 * rgba[at] + 0.7152 * rgba[at + 1] + 0.0722 * rgba[at + 2];
    };
    ASSERT_EQ(gray[i], std::floor(luma(4 * i) * rgba[4 * i + 3] / 255 + 0.5 + 1e-9));
    ASSERT_EQ(gray_rgb[i], std::floor(luma(3 * i) + 0.5 + 1e-9));
  }
  EXPECT_EQ(
      (converted<uint16_t>(color_info({1, 1, 1}, VoxelFormat::rgba32), Bytes{255, 255, 255, 255}, "u16")),
      Shorts{255});
}

TEST_F(ConvertTest, Bits) {
  EXPECT_EQ((converted<uint8_t>(scalar_info({4, 1, 1}, SampleType::i8), Bytes{0, 128, 129, 255}, "bit")),
            (Bytes{1, 0, 1, 1}));
  EXPECT_EQ((converted<uint8_t>(scalar_info({4, 1, 1}, SampleType::f32),
                                Floats{0, -0.f, 1e-30f, std::nanf("")}, "bit")),
            (Bytes{0, 0, 1, 0}));
  EXPECT_EQ(
      (converted<uint8_t>(color_info({2, 1, 1}, VoxelFormat::rgba32), Bytes{9, 9, 9, 0, 0, 0, 0, 1}, "bit")),
      (Bytes{0, 1}));
  EXPECT_EQ((converted<uint8_t>(color_info({2, 1, 1}, VoxelFormat::rgb24), Bytes{0, 0, 0, 0, 0, 1}, "bit")),
            (Bytes{0, 1}));
  EXPECT_EQ((converted<uint8_t>(scalar_info({2, 1, 1}, SampleType::bit), Bytes{0, 1}, "u8")), (Bytes{0, 1}));
}

TEST_F(ConvertTest, UnknownTypesAreRefused) {
  for (const char* name : {"", "u32", "U8", "rgb"}) {
    const auto type = parse_target_type(name);
    ASSERT_FALSE(type);
    EXPECT_EQ(type.error().code, ErrorCode::usage);
  }
}

TEST_F(ConvertTest, UniformAndForwardOnlyFollow) {
  auto flat = convert_type(
      std::make_unique<FlatSource>(scalar_info({9, 9, 9}, SampleType::i8), Voxel::of(uint8_t{130})),
      *parse_target_type("f32"), {}, ctx_);
  ASSERT_TRUE(flat);
  EXPECT_EQ((*flat)->uniform((*flat)->info().box())->as<float>(), 2);
  Bytes values(5 * 4 * 3);
  std::iota(values.begin(), values.end(), uint8_t{0});
  auto forward = convert_type(
      std::make_unique<ForwardSource>(scalar_info({5, 4, 3}, SampleType::u8), test::bytes_of(values)),
      *parse_target_type("u16"), {}, ctx_);
  ASSERT_TRUE(forward);
  EXPECT_EQ(read_all<uint16_t>(**forward, {100, 100, 2}), Shorts(values.begin(), values.end()));
}

TEST_F(ConvertTest, ApplyScale) {
  VolumeInfo info = scalar_info({3, 1, 1}, SampleType::i16);
  info.slope = 2;
  info.intercept = -1;
  auto scaled = apply_scale(volume(info, Shorts{32768, 32769, 0}), ctx_);
  ASSERT_TRUE(scaled);
  EXPECT_EQ(read_all<float>(**scaled), (Floats{-1, 1, -65537}));
  EXPECT_EQ((*scaled)->info().slope, 1);
  EXPECT_FALSE(apply_scale(volume(color_info({1, 1, 1}, VoxelFormat::rgb24), Bytes(3)), ctx_));
}

/// Weight of source voxel v in voxel i along an axis from n to m voxels: the plain definition, as a fraction.
double weight(int64_t i, int64_t v, int64_t n, int64_t m) {
  const double scale = double(n) / double(m);
  if (m <= n) {
    const double lo = double(i) * scale, hi = lo + scale;
    return std::max(0.0, std::min(hi, double(v + 1)) - std::max(lo, double(v))) / scale;
  }
  const double at = std::clamp((double(i) + 0.5) * scale - 0.5, 0.0, double(n - 1));
  return std::max(0.0, 1 - std::abs(at - double(v)));
}

TEST_F(ConvertTest, ResampleMatchesThePlainDefinition) {
  std::mt19937 random(11);
  const Index3 from(7, 6, 5);
  Bytes values(7 * 6 * 5 * 4);
  for (uint8_t& v : values) v = static_cast<uint8_t>(random() % 4 ? random() : 0);
  Floats floats(values.begin(), values.end());
  floats.resize(7 * 6 * 5);
  for (const Index3 to : {Index3(7, 6, 1), Index3(1, 1, 1), Index3(14, 12, 10), Index3(3, 9, 5),
                          Index3(4, 4, 4), Index3(20, 2, 3)}) {
    VolumeInfo info = color_info(from, VoxelFormat::rgba32);
    info.affine.origin = {1, 2, 3};
    auto colors = resample(volume(info, values), to);
    ASSERT_TRUE(colors);
    const Bytes got = read_all<uint8_t>(**colors);
    EXPECT_EQ(got, read_all<uint8_t>(**colors, {3, 2, 2}));
    auto real = resample(volume(scalar_info(from, SampleType::f32), floats), to);
    ASSERT_TRUE(real);
    const Floats got_real = read_all<float>(**real);
    size_t at = 0;
    for (int64_t z = 0; z < to.z; ++z)
      for (int64_t y = 0; y < to.y; ++y)
        for (int64_t x = 0; x < to.x; ++x, ++at) {
          double sum[4] = {}, scalar = 0;
          for (int64_t i = 0; i < 210; ++i) {
            const double w =
                weight(x, i % 7, 7, to.x) * weight(y, i / 7 % 6, 6, to.y) * weight(z, i / 42, 5, to.z);
            const uint8_t* v = &values[static_cast<size_t>(4 * i)];
            for (int c = 0; c < 3; ++c) sum[c] += w * v[c] * v[3];
            sum[3] += w * v[3];
            scalar += w * floats[static_cast<size_t>(i)];
          }
          for (size_t c = 0; c < 3; ++c) {
            ASSERT_NEAR(got[4 * at + c], sum[3] > 1e-9 ? sum[c] / sum[3] : 0, 0.5 + 1e-6);
          }
          ASSERT_NEAR(got[4 * at + 3], sum[3], 0.5 + 1e-6);
          ASSERT_NEAR(got_real[at], scalar, 1e-3);
        }
    // The outer faces stay where they are.
    const VolumeInfo& made = (*colors)->info();
    for (int a = 0; a < 3; ++a) {
      EXPECT_DOUBLE_EQ(made.affine.origin[a] - made.affine.spacing()[a] / 2, a + 0.5);
      EXPECT_DOUBLE_EQ(made.affine.origin[a] + made.affine.spacing()[a] * (double(to[a]) - 0.5),
                       a + 0.5 + double(from[a]));
    }
  }
}

TEST_F(ConvertTest, ResampleRoundsExactly) {
  auto half = resample(volume(scalar_info({2, 1, 1}, SampleType::u8), Bytes{1, 2}), {1, 1, 1});
  EXPECT_EQ(read_all<uint8_t>(**half), Bytes{2});
  auto third =
      resample(volume(scalar_info({3, 1, 1}, SampleType::u16), Shorts{65535, 65535, 65534}), {1, 1, 1});
  EXPECT_EQ(read_all<uint16_t>(**third), Shorts{65535});
  auto flat = resample(volume(scalar_info({3, 2, 2}, SampleType::u16), Shorts(12, 65535)), {50, 31, 7});
  EXPECT_EQ(read_all<uint16_t>(**flat), Shorts(50 * 31 * 7, 65535));
}

TEST_F(ConvertTest, ResampleLimits) {
  const VolumeInfo info = scalar_info({4, 4, 4}, SampleType::u8);
  for (const Index3 dims : {Index3(0, 1, 1), Index3(1, -1, 1), Index3(1, 1, (1 << 20) + 1)})
    EXPECT_FALSE(resample(volume(info, Bytes(64)), dims));
  EXPECT_FALSE(resample(std::make_unique<ForwardSource>(info, std::vector<std::byte>(64)), {2, 2, 2}));
  EXPECT_FALSE(resample(
      std::make_unique<FlatSource>(scalar_info({1000, 1000, 1000}, SampleType::u8), Voxel{}), {1, 1, 1}));
  auto flat =
      resample(std::make_unique<FlatSource>(scalar_info({10, 1, 1}, SampleType::u8), Voxel::of(uint8_t{3})),
               {5, 5, 5});
  EXPECT_EQ((*flat)->uniform((*flat)->info().box()), Voxel::of(uint8_t{3}));
}

TEST_F(ConvertTest, LargeReductionsAreReadInParts) {
  // 2000 x 2 x 2 source voxels a voxel: more than one part.
  const Index3 dims(16000, 16, 16);
  Bytes values(static_cast<size_t>(dims.x * dims.y * dims.z));
  for (size_t i = 0; i < values.size(); ++i) values[i] = static_cast<uint8_t>(i % 16000 / 2000 * 10);
  auto source = resample(volume(scalar_info(dims, SampleType::u8), values), {8, 2, 2});
  const Bytes out = read_all<uint8_t>(**source);
  ASSERT_EQ(out.size(), 32u);
  for (size_t i = 0; i < 32; ++i) EXPECT_EQ(out[i], i % 8 * 10);
}

}  // namespace
}  // namespace voxkit
