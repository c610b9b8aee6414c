// Histograms of errors beside plain loops over sorted errors.
#include "libmetrics/error_histogram.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "libmetrics/image_diff.h"
#include "libmetrics/volume_diff.h"
#include "tests/libmetrics/pictures.h"
#include "tests/memory_volume.h"

namespace voxkit {
namespace {

using Kind = ErrorHistogram::Kind;
using test::bytes_of;
using test::color_info;
using test::FlatSource;
using test::MemorySource;
using test::scalar_info;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// The first error of the bin that holds `error`: 0, or an eighth of the way from a power of two to the next.
double least_of(Kind kind, double error) {
  if (kind == Kind::bytes || error == 0 || std::isinf(error)) return error;
  const double power = std::exp2(std::floor(std::log2(error)));
  return power * (1 + std::floor((error / power - 1) * 8) / 8);
}

void expect_counts(Kind kind, std::vector<double> errors, const ErrorHistogram& histogram) {
  std::map<double, uint64_t> expected;
  for (const double error : errors) ++expected[least_of(kind, error)];
  const auto bins = histogram.bins();
  ASSERT_EQ(bins.size(), expected.size());
  auto bin = bins.begin();
  for (const auto& [least, count] : expected) {
    EXPECT_EQ(bin->least, least);
    EXPECT_EQ(bin->count, count) << least;
    ++bin;
  }
  EXPECT_EQ(histogram.samples(), errors.size());

  std::sort(errors.begin(), errors.end());
  for (const double share : {0.001, 0.25, 0.5, 0.95, 0.99, 0.999, 1.0}) {
    const double rank = std::ceil(share * static_cast<double>(errors.size()));
    const double exact = errors[static_cast<size_t>(rank) - 1], got = histogram.percentile(share);
    EXPECT_GE(got, exact) << share;
    EXPECT_LE(got, errors.back()) << share;
    if (kind == Kind::bytes || (kind == Kind::whole && exact < 16) || std::isinf(exact))
      EXPECT_EQ(got, exact) << share;
    else
      EXPECT_LE(got, exact * 9 / 8) << share;
    if (kind == Kind::whole) {
      EXPECT_EQ(got, std::floor(got)) << share;
    }
  }
}

TEST(ErrorHistogramTest, CountsAsAPlainLoopDoes) {
  std::mt19937 random(1);
  for (const Kind kind : {Kind::bytes, Kind::whole, Kind::real})
    for (const size_t count : {size_t{1}, size_t{2}, size_t{1000}, size_t{30000}}) {
      std::vector<double> errors;
      ErrorHistogram histogram(kind);
      for (size_t i = 0; i < count; ++i) {
        // Of all magnitudes.
        const auto bits = random() % (kind == Kind::bytes ? 9 : 17);
        double error = static_cast<double>(random() % (1u << bits));
        if (kind == Kind::real) error = std::ldexp(error, static_cast<int>(random() % 200) - 140);
        errors.push_back(error);
        histogram.add(error);
      }
      expect_counts(kind, errors, histogram);
    }
}

TEST(ErrorHistogramTest, ExtremesHaveBins) {
  const float denormal = std::numeric_limits<float>::denorm_min(), most = std::numeric_limits<float>::max();
  ErrorHistogram real(Kind::real);
  const std::vector<double> errors = {0, double{denormal}, double{most}, 2 * double{most}, infinity};
  for (const double error : errors) real.add(error);
  expect_counts(Kind::real, errors, real);
  EXPECT_EQ(real.percentile(1), infinity);
  // Signed beside unsigned samples.
  ErrorHistogram bytes(Kind::bytes), whole(Kind::whole);
  bytes.add(383);
  whole.add(98303);
  EXPECT_EQ(bytes.percentile(0.5), 383);
  EXPECT_EQ(whole.percentile(0.5), 98303);
  EXPECT_EQ(ErrorHistogram(Kind::real).percentile(0.5), 0);
  EXPECT_TRUE(ErrorHistogram(Kind::bytes).bins().empty());
}

class HistogramOfTest : public testing::Test {
 protected:
  Context context(int threads) { return {.threads = threads, .memory = &memory_}; }
  MemoryBudget memory_{1 << 26};
};

template <class T>
void expect_volume(Kind kind, const VolumeInfo& info, MemoryBudget& memory, unsigned modulus) {
  const size_t count = static_cast<size_t>(info.box().voxels() * voxel_bytes(info.format)) / sizeof(T);
  std::mt19937 random(7);
  std::vector<T> a(count), b(count);
  std::vector<double> errors;
  for (size_t i = 0; i < count; ++i) {
    a[i] = static_cast<T>(random() % modulus);
    b[i] = random() % 3 == 0 ? a[i] : static_cast<T>(random() % modulus);
    errors.push_back(std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  }
  MemorySource source_a(info, bytes_of(a)), source_b(info, bytes_of(b));
  for (const int threads : {1, 7}) {
    Context ctx{.threads = threads, .memory = &memory};
    ErrorHistogram histogram;
    ASSERT_TRUE(diff_volumes(source_a, source_b, {}, nullptr, ctx, &histogram));
    expect_counts(kind, errors, histogram);
  }
}

TEST_F(HistogramOfTest, VolumesOfEveryKind) {
  const Index3 dims(600, 67, 35);  // several tiles
  expect_volume<uint8_t>(Kind::bytes, scalar_info(dims, SampleType::u8), memory_, 256);
  expect_volume<uint16_t>(Kind::whole, scalar_info(dims, SampleType::u16), memory_, 65536);
  expect_volume<float>(Kind::real, scalar_info(dims, SampleType::f32), memory_, 1 << 24);
  expect_volume<uint8_t>(Kind::bytes, color_info({90, 30, 20}, VoxelFormat::rgb24), memory_, 256);
  expect_volume<uint8_t>(Kind::bytes, color_info({90, 30, 20}, VoxelFormat::rgba32), memory_, 256);
}

TEST_F(HistogramOfTest, UniformVolumesAreCountedWithoutBeingRead) {
  const VolumeInfo info = scalar_info({3000, 2000, 1000}, SampleType::u8);
  Voxel three, five;
  three.bytes[0] = std::byte{3};
  five.bytes[0] = std::byte{5};
  FlatSource a(info, three), b(info, five);
  Context ctx = context(2);
  ErrorHistogram histogram;
  ASSERT_TRUE(diff_volumes(a, b, {}, nullptr, ctx, &histogram));
  const auto bins = histogram.bins();
  ASSERT_EQ(bins.size(), 1u);
  EXPECT_EQ(bins[0].least, 2);
  EXPECT_EQ(bins[0].count, 6000000000u);
}

TEST_F(HistogramOfTest, ANumberBesideNoneIsAnInfiniteError) {
  const VolumeInfo info = scalar_info({3, 1, 1}, SampleType::f32);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  MemorySource a(info, bytes_of(std::vector<float>{1, nan, nan}));
  MemorySource b(info, bytes_of(std::vector<float>{1, nan, 2}));
  Context ctx = context(1);
  ErrorHistogram histogram;
  ASSERT_TRUE(diff_volumes(a, b, {}, nullptr, ctx, &histogram));
  expect_counts(Kind::real, {0, 0, infinity}, histogram);
}

TEST_F(HistogramOfTest, ImagesOfEveryKind) {
  for (const SampleType type : {SampleType::u8, SampleType::u16, SampleType::f32}) {
    const Kind kind = type == SampleType::u8    ? Kind::bytes
                      : type == SampleType::u16 ? Kind::whole
                                                : Kind::real;
    for (const int channels : {1, 3, 4}) {
      std::mt19937 random(9);
      Context seven = context(7), one = context(1);
      const auto noise = [&](int64_t, int64_t, int) {
        const auto value = static_cast<double>(random() % 65536);
        return type == SampleType::u8    ? std::floor(value / 256)
               : type == SampleType::u16 ? value
                                         : value / 65536;
      };
      const Image a = test::picture(211, 157, channels, type, one, noise);
      const Image b = test::picture(211, 157, channels, type, one, noise);
      std::vector<double> errors;
      for (int64_t i = 0; i < 211 * 157 * channels; ++i)
        errors.push_back(std::abs(static_cast<double>(a.row(0)[i]) - static_cast<double>(b.row(0)[i])));
      for (Context* ctx : {&one, &seven}) {
        ErrorHistogram histogram;
        ASSERT_TRUE(diff_images(a, b, {}, *ctx, &histogram));
        expect_counts(kind, errors, histogram);
      }
    }
  }
}

}  // namespace
}  // namespace voxkit
