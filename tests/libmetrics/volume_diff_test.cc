#include "libmetrics/volume_diff.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "formats/full_scale.h"
#include "tests/memory_volume.h"

namespace voxkit {
namespace {

using test::bytes_of;
using test::color_info;
using test::FlatSource;
using test::ForwardSource;
using test::MemorySink;
using test::MemorySource;
using test::scalar_info;
using test::volume;

constexpr double infinity = std::numeric_limits<double>::infinity();

class VolumeDiffTest : public testing::Test {
 protected:
  VolumeDiff diff(VolumeSource& a, VolumeSource& b, int threads = 2, VolumeSink* errors = nullptr) {
    Context ctx{.threads = threads, .memory = &memory_};
    auto result = diff_volumes(a, b, {}, errors, ctx);
    EXPECT_TRUE(result) << result.error().what;
    return result ? *result : VolumeDiff{};
  }
  template <class T>
  VolumeDiff diff(const VolumeInfo& info, const std::vector<T>& a, const std::vector<T>& b) {
    return diff(*volume(info, a), *volume(info, b));
  }
  MemoryBudget memory_{1 << 22};
};

template <class T>
std::vector<T> random_values(size_t count, unsigned seed, unsigned modulus) {
  std::mt19937 random(seed);
  std::vector<T> values(count);
  for (T& v : values) v = static_cast<T>(random() % modulus);
  return values;
}

/// Textbook sums in long double.
struct Plain {
  long double squares = 0, absolute = 0, signal = 0, greatest = 0;
  void add(long double a, long double b) {
    const long double d = std::abs(a - b);
    squares += d * d;
    absolute += d;
    signal += a * a;
    greatest = std::max(greatest, d);
  }
};

TEST_F(VolumeDiffTest, SixteenBitsMatchThePlainFormulas) {
  for (const Index3 dims : {Index3(1, 1, 1), Index3(37, 29, 41), Index3(700, 70, 35)}) {
    const auto count = static_cast<size_t>(dims.x * dims.y * dims.z);
    auto a = random_values<uint16_t>(count, 1, 4096), b = a;
    for (size_t i = 0; i < count; i += 3) b[i] = static_cast<uint16_t>((b[i] * 7 + 1) % 4096);
    Plain plain;
    uint64_t differing = 0;
    for (size_t i = 0; i < count; ++i) {
      plain.add(a[i], b[i]);
      differing += a[i] != b[i];
    }
    a[0] = b[0] = 4095;  // certain 12 bits
    plain = {};
    differing = 0;
    for (size_t i = 0; i < count; ++i) {
      plain.add(a[i], b[i]);
      differing += a[i] != b[i];
    }
    const VolumeDiff d = diff(scalar_info(dims, SampleType::u16), a, b);
    const auto n = static_cast<long double>(count);
    EXPECT_EQ(d.voxels, count);
    EXPECT_EQ(d.peak, 4095);
    EXPECT_DOUBLE_EQ(d.mse, static_cast<double>(plain.squares / n));
    EXPECT_DOUBLE_EQ(d.rmse, std::sqrt(d.mse));
    EXPECT_DOUBLE_EQ(d.mean_abs_error, static_cast<double>(plain.absolute / n));
    EXPECT_EQ(d.max_abs_error, static_cast<double>(plain.greatest));
    EXPECT_EQ(d.differing_voxels, differing);
    if (differing > 0) {
      EXPECT_NEAR(d.psnr_db, 20 * std::log10(4095) - 10 * std::log10(d.mse), 1e-9);
      EXPECT_NEAR(d.snr_db, static_cast<double>(10 * std::log10(plain.signal / plain.squares)), 1e-9);
    } else {
      EXPECT_EQ(d.psnr_db, infinity);
    }
  }
}

TEST_F(VolumeDiffTest, SameForAnyThreadsAndKindOfSource) {
  const Index3 dims(600, 130, 70);
  const auto count = static_cast<size_t>(dims.x * dims.y * dims.z);
  std::mt19937 random(4);
  std::vector<float> a(count), b(count);
  for (size_t i = 0; i < count; ++i) {
    a[i] = static_cast<float>(random()) * 1e-9f;
    b[i] = a[i] + static_cast<float>(random()) * 1e-12f;
  }
  const VolumeInfo info = scalar_info(dims, SampleType::f32);
  MemorySource source_a(info, bytes_of(a)), source_b(info, bytes_of(b));
  const VolumeDiff one = diff(source_a, source_b, 1);
  EXPECT_GT(one.mse, 0);
  for (const int threads : {2, 5}) {
    ForwardSource forward(info, bytes_of(b));
    for (VolumeSource* other :
         {static_cast<VolumeSource*>(&source_b), static_cast<VolumeSource*>(&forward)}) {
      const VolumeDiff many = diff(source_a, *other, threads);
      EXPECT_EQ(one.mse, many.mse);
      EXPECT_EQ(one.snr_db, many.snr_db);
      EXPECT_EQ(one.mean_abs_error, many.mean_abs_error);
    }
  }
}

TEST_F(VolumeDiffTest, Colors) {
  const Index3 dims(40, 5, 3);
  const auto a = random_values<uint8_t>(600 * 4, 1, 256), b = random_values<uint8_t>(600 * 4, 2, 256);
  Plain all, rgb;
  for (size_t i = 0; i < a.size(); ++i) {
    all.add(a[i], b[i]);
    if (i % 4 < 3) rgb.add(a[i], b[i]);
  }
  const VolumeDiff d = diff(color_info(dims, VoxelFormat::rgba32), a, b);
  EXPECT_EQ(d.peak, 255);
  EXPECT_DOUBLE_EQ(d.mse, static_cast<double>(all.squares / 2400));
  EXPECT_DOUBLE_EQ(*d.grmse, static_cast<double>(std::sqrt(rgb.squares / 1800)));
  EXPECT_DOUBLE_EQ(*d.grmse_distance, static_cast<double>(std::sqrt(rgb.squares / 600)));
  EXPECT_DOUBLE_EQ(d.snr_db, static_cast<double>(10 * std::log10(all.signal / all.squares)));

  const VolumeDiff mixed =
      diff(*volume(color_info({1, 1, 1}, VoxelFormat::rgb24), std::vector<uint8_t>{1, 2, 3}),
           *volume(color_info({1, 1, 1}, VoxelFormat::rgba32), std::vector<uint8_t>{1, 2, 3, 251}));
  EXPECT_EQ(mixed.mse, 4);
  EXPECT_EQ(*mixed.grmse, 0);
}

TEST_F(VolumeDiffTest, Floats) {
  const float nan = std::nanf(""), inf = std::numeric_limits<float>::infinity();
  const VolumeInfo info = scalar_info({4, 1, 1}, SampleType::f32);
  using Floats = std::vector<float>;
  const VolumeDiff same = diff(info, Floats{nan, inf, -3, 0}, Floats{nan, inf, -3, 0});
  EXPECT_EQ(same.differing_voxels, 0u);
  EXPECT_EQ(same.psnr_db, infinity);
  EXPECT_EQ(same.peak, 3);
  const VolumeDiff zeros = diff(info, Floats{0, 0, 1, 2}, Floats{-0.f, 0, 1, 2});
  EXPECT_EQ(zeros.differing_voxels, 1u);
  EXPECT_EQ(zeros.mse, 0);
  const VolumeDiff one_nan = diff(info, Floats{nan, 0, 1, 2}, Floats{0, 0, 1, 2});
  EXPECT_EQ(one_nan.max_abs_error, infinity);
  EXPECT_EQ(one_nan.mse, infinity);
  EXPECT_EQ(one_nan.psnr_db, -infinity);
  EXPECT_EQ(diff(info, Floats{inf, 0, 1, 2}, Floats{-inf, 0, 1, 2}).max_abs_error, infinity);
}

TEST_F(VolumeDiffTest, FormatsThatDifferMeetInSampleValues) {
  const VolumeDiff d =
      diff(*volume(scalar_info({3, 1, 1}, SampleType::i8), std::vector<uint8_t>{0, 128, 255}),
           *volume(scalar_info({3, 1, 1}, SampleType::f32), std::vector<float>{-128, 0, 130}));
  EXPECT_EQ(d.max_abs_error, 3);
  EXPECT_EQ(d.differing_voxels, 1u);
  const VolumeDiff biased =
      diff(*volume(scalar_info({2, 1, 1}, SampleType::u8), std::vector<uint8_t>{0, 255}),
           *volume(scalar_info({2, 1, 1}, SampleType::i16), std::vector<uint16_t>{32768, 33023}));
  EXPECT_EQ(biased.differing_voxels, 0u);
}

TEST_F(VolumeDiffTest, UniformBoxesAreNotRead) {
  // 10^18 voxels whose squared errors need more than 64 bits.
  const VolumeInfo info = scalar_info({1000000, 1000000, 1000000}, SampleType::u16);
  FlatSource a(info, Voxel::of(uint16_t{65535})), b(info, Voxel::of(uint16_t{0}));
  MemoryBudget memory(uint64_t{1} << 60);
  Context ctx{.threads = 1, .memory = &memory};
  const auto d = diff_volumes(a, b, {}, nullptr, ctx);
  ASSERT_TRUE(d);
  EXPECT_DOUBLE_EQ(d->rmse, 65535);
  EXPECT_EQ(d->differing_voxels, 1000000000000000000u);
  EXPECT_DOUBLE_EQ(d->psnr_db, 0);
}

TEST_F(VolumeDiffTest, ErrorVolume) {
  const Index3 dims(50, 40, 30);
  const auto a = random_values<uint8_t>(60000, 1, 256), b = random_values<uint8_t>(60000, 2, 256);
  for (const VoxelFormat format : {VoxelFormat::density8, VoxelFormat::rgb24}) {
    VolumeInfo info = color_info(format == VoxelFormat::rgb24 ? Index3(50, 40, 10) : dims, format);
    MemorySource source_a(info, bytes_of(a)), source_b(info, bytes_of(b));
    EXPECT_EQ(error_volume_info(info, info).format, format);
    MemorySink sink(info.dims, format);
    diff(source_a, source_b, 2, &sink);
    ASSERT_TRUE(sink.finished);
    for (size_t i = 0; i < a.size(); ++i)
      ASSERT_EQ(std::to_integer<int>(sink.voxels[i]), std::abs(a[i] - b[i]));
  }
  const VolumeInfo bytes = scalar_info(dims, SampleType::u8), shorts = scalar_info(dims, SampleType::u16);
  EXPECT_EQ(error_volume_info(bytes, shorts).format, VoxelFormat::float32);
  MemorySink sink(dims, VoxelFormat::float32);
  diff(*volume(bytes, a), *volume(shorts, std::vector<uint16_t>(b.begin(), b.end())), 2, &sink);
  ASSERT_EQ(sink.voxels.size(), 240000u);
  float error;
  std::memcpy(&error, &sink.voxels[4 * 777], 4);
  EXPECT_EQ(error, std::abs(a[777] - b[777]));
  FlatSource flat_a(bytes, Voxel::of(uint8_t{3})), flat_b(bytes, Voxel::of(uint8_t{10}));
  MemorySink flat_sink(dims, VoxelFormat::density8);
  diff(flat_a, flat_b, 2, &flat_sink);
  EXPECT_EQ(flat_sink.voxels, std::vector<std::byte>(60000, std::byte{7}));
}

TEST_F(VolumeDiffTest, RefusesWhatCannotBeCompared) {
  Context ctx{.threads = 1, .memory = &memory_};
  auto a = volume(scalar_info({2, 1, 1}, SampleType::u8), std::vector<uint8_t>(2));
  auto longer = volume(scalar_info({3, 1, 1}, SampleType::u8), std::vector<uint8_t>(3));
  auto color = volume(color_info({2, 1, 1}, VoxelFormat::rgb24), std::vector<uint8_t>(6));
  for (VolumeSource* b : {longer.get(), color.get()}) {
    const auto d = diff_volumes(*a, *b, {}, nullptr, ctx);
    ASSERT_FALSE(d);
    EXPECT_EQ(d.error().code, ErrorCode::usage);
  }
}

TEST(FullScale, OfEveryFormat) {
  EXPECT_EQ(full_scale(scalar_info({1, 1, 1}, SampleType::bit), {}), 1);
  EXPECT_EQ(full_scale(scalar_info({1, 1, 1}, SampleType::i8), {}), 255);
  EXPECT_EQ(full_scale(color_info({1, 1, 1}, VoxelFormat::rgb24), {}), 255);
  EXPECT_EQ(full_scale(scalar_info({1, 1, 1}, SampleType::u16), {1000, 4095}), 4095);
  EXPECT_EQ(full_scale(scalar_info({1, 1, 1}, SampleType::u16), {0, 4096}), 8191);
  EXPECT_EQ(full_scale(scalar_info({1, 1, 1}, SampleType::u16), {0, 0}), 1);
  EXPECT_EQ(full_scale(scalar_info({1, 1, 1}, SampleType::u16), {0, 65535}), 65535);
  // -1024 .. 3071: 12 bits; 1000 .. 1001 extends to 0: 10 bits.
  EXPECT_EQ(full_scale(scalar_info({1, 1, 1}, SampleType::i16), {31744, 35839}), 4095);
  EXPECT_EQ(full_scale(scalar_info({1, 1, 1}, SampleType::i16), {33768, 33769}), 1023);
  EXPECT_EQ(full_scale(scalar_info({1, 1, 1}, SampleType::f32), {-2, 3.5}), 5.5);
  EXPECT_EQ(full_scale(scalar_info({1, 1, 1}, SampleType::f32), {2, 2}), 1);
}

}  // namespace
}  // namespace voxkit
