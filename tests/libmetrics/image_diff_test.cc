#include "libmetrics/image_diff.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tests/libmetrics/pictures.h"

namespace voxkit {
namespace {

using test::picture;

constexpr double infinity = std::numeric_limits<double>::infinity();

class ImageDiffTest : public testing::Test {
 protected:
  ImageDiff diff(const Image& a, const Image& b, int threads = 2, std::optional<double> peak = {}) {
    Context ctx{.threads = threads, .memory = &memory_};
    const auto result = diff_images(a, b, peak, ctx);
    EXPECT_TRUE(result) << result.error().what;
    return result ? *result : ImageDiff{};
  }
  Image noise(int64_t width, int64_t height, int channels, SampleType type, unsigned seed) {
    std::mt19937 random(seed);
    return picture(width, height, channels, type, ctx_, [&](int64_t, int64_t, int) {
      const auto value = static_cast<double>(random() % 65536);
      return type == SampleType::f32   ? value / 65536
             : sample_bytes(type) == 1 ? std::floor(value / 256)
                                       : value;
    });
  }
  MemoryBudget memory_{1 << 26};
  Context ctx_{.threads = 2, .memory = &memory_};
};

TEST_F(ImageDiffTest, AgreesWithTextbookSums) {
  for (const SampleType type : {SampleType::u8, SampleType::u16, SampleType::f32})
    for (const int channels : {1, 2, 3, 4}) {
      const Image a = noise(171, 103, channels, type, 1);
      Image b = noise(171, 103, channels, type, 2);
      long double squares = 0, color_squares = 0, greatest = 0;
      int64_t differing = 0;
      for (int64_t y = 0; y < 103; ++y)
        for (int64_t x = 0; x < 171; ++x) {
          bool differs = false;
          for (int c = 0; c < channels; ++c) {
            float& sample = b.row(y)[x * channels + c];
            if ((x + y) % 3 == 0) sample = a.row(y)[x * channels + c];
            const long double d = std::abs(static_cast<long double>(a.row(y)[x * channels + c]) - sample);
            squares += d * d;
            if (c < 3) color_squares += d * d;
            greatest = std::max(greatest, d);
            differs |= d != 0;
          }
          differing += differs;
        }
      const double pixels = 171 * 103, peak = a.peak();
      const double mse = static_cast<double>(squares) / (pixels * channels);
      const ImageDiff got = diff(a, b);
      EXPECT_EQ(got.width, 171);
      EXPECT_EQ(got.height, 103);
      EXPECT_EQ(got.channels, channels);
      EXPECT_EQ(got.peak, type == SampleType::u8 ? 255 : type == SampleType::u16 ? 65535 : 1);
      EXPECT_NEAR(got.mse / mse, 1, 1e-12);
      EXPECT_NEAR(got.rmse / std::sqrt(mse), 1, 1e-12);
      EXPECT_NEAR(got.psnr_db, 10 * std::log10(peak * peak / mse), 1e-9);
      EXPECT_EQ(got.max_abs_error, static_cast<double>(greatest));
      EXPECT_EQ(got.differing_pixels, differing);
      ASSERT_EQ(got.grmse.has_value(), channels > 2);
      if (got.grmse) {
        const double rms = std::sqrt(static_cast<double>(color_squares) / pixels) * 255 / peak;
        EXPECT_NEAR(*got.grmse_distance / rms, 1, 1e-12);
        EXPECT_NEAR(*got.grmse / (rms / std::sqrt(3.0)), 1, 1e-12);
      }
    }
}

TEST_F(ImageDiffTest, EqualImages) {
  const Image a = noise(50, 40, 3, SampleType::u8, 3);
  const ImageDiff got = diff(a, a);
  EXPECT_EQ(got.rmse, 0);
  EXPECT_EQ(got.psnr_db, infinity);
  EXPECT_EQ(got.max_abs_error, 0);
  EXPECT_EQ(got.differing_pixels, 0);
  EXPECT_EQ(*got.grmse, 0);
}

TEST_F(ImageDiffTest, KnownValues) {
  const Image black = picture(4, 2, 3, SampleType::u8, ctx_, [](int64_t, int64_t, int) { return 0.0; });
  const Image white = picture(4, 2, 3, SampleType::u8, ctx_, [](int64_t, int64_t, int) { return 255.0; });
  const ImageDiff got = diff(black, white);
  EXPECT_EQ(got.rmse, 255);
  EXPECT_EQ(got.psnr_db, 0);
  EXPECT_NEAR(*got.grmse, 255, 1e-12);
  EXPECT_NEAR(*got.grmse_distance, 255 * std::sqrt(3.0), 1e-12);
  EXPECT_NEAR(diff(black, white, 2, 2550).psnr_db, 20, 1e-12);
}

TEST_F(ImageDiffTest, WithoutAlphaIsOpaque) {
  const Image rgb = noise(30, 20, 3, SampleType::u8, 4);
  const Image rgba = picture(30, 20, 4, SampleType::u8, ctx_, [&](int64_t x, int64_t y, int c) {
    return c < 3 ? static_cast<double>(rgb.row(y)[3 * x + c]) : x == 0 ? 250.0 : 255.0;
  });
  for (const ImageDiff& got : {diff(rgb, rgba), diff(rgba, rgb)}) {
    EXPECT_EQ(got.channels, 4);
    EXPECT_EQ(got.max_abs_error, 5);
    EXPECT_EQ(got.differing_pixels, 20);
    EXPECT_EQ(*got.grmse, 0);
  }
}

TEST_F(ImageDiffTest, NoNumbers) {
  Image a = noise(20, 20, 1, SampleType::f32, 5), b = noise(20, 20, 1, SampleType::f32, 5);
  a.row(3)[4] = b.row(3)[4] = std::numeric_limits<float>::quiet_NaN();
  a.row(5)[4] = b.row(5)[4] = -std::numeric_limits<float>::infinity();
  EXPECT_EQ(diff(a, b).differing_pixels, 0);
  b.row(3)[4] = 1;
  EXPECT_EQ(diff(a, b).differing_pixels, 1);
  EXPECT_EQ(diff(a, b).max_abs_error, infinity);
  EXPECT_EQ(diff(a, b).psnr_db, -infinity);
}

TEST_F(ImageDiffTest, SameBitsForAnyNumberOfThreads) {
  const Image a = noise(517, 391, 3, SampleType::f32, 6), b = noise(517, 391, 3, SampleType::f32, 7);
  const ImageDiff one = diff(a, b, 1);
  for (const int threads : {2, 7}) {
    EXPECT_EQ(diff(a, b, threads).mse, one.mse);
    EXPECT_EQ(*diff(a, b, threads).grmse, *one.grmse);
  }
}

TEST_F(ImageDiffTest, ErrorImage) {
  const Image a = noise(33, 21, 4, SampleType::u16, 8), b = noise(33, 21, 3, SampleType::u16, 9);
  const auto errors = error_image(a, b, ctx_);
  ASSERT_TRUE(errors);
  EXPECT_EQ(errors->channels(), 4);
  EXPECT_EQ(errors->type(), SampleType::u16);
  for (int64_t y = 0; y < 21; ++y)
    for (int64_t x = 0; x < 33; ++x)
      for (int c = 0; c < 4; ++c)
        EXPECT_EQ(errors->row(y)[4 * x + c],
                  std::abs(a.row(y)[4 * x + c] - (c < 3 ? b.row(y)[3 * x + c] : 65535.0f)));
  const Image low = picture(2, 2, 1, SampleType::i16, ctx_, [](int64_t, int64_t, int) { return -32768.0; });
  const Image high = picture(2, 2, 1, SampleType::i16, ctx_, [](int64_t, int64_t, int) { return 32767.0; });
  const auto wide = error_image(low, high, ctx_);
  ASSERT_TRUE(wide);
  EXPECT_EQ(wide->type(), SampleType::u16);
  EXPECT_EQ(wide->row(1)[1], 65535);
}

TEST_F(ImageDiffTest, RefusesWhatCannotBeCompared) {
  const Image a = noise(20, 20, 3, SampleType::u8, 1);
  for (const Image& other : {noise(20, 21, 3, SampleType::u8, 1), noise(20, 20, 3, SampleType::u16, 1),
                             noise(20, 20, 1, SampleType::u8, 1), noise(20, 20, 3, SampleType::f32, 1)}) {
    EXPECT_EQ(diff_images(a, other, {}, ctx_).error().code, ErrorCode::usage);
    EXPECT_EQ(error_image(a, other, ctx_).error().code, ErrorCode::usage);
  }
}

TEST(ImageTest, RefusesWhatIsNoImage) {
  MemoryBudget memory(1 << 20);
  Context ctx{.threads = 1, .memory = &memory};
  EXPECT_EQ(Image::create(0, 4, 1, SampleType::u8, ctx).error().code, ErrorCode::usage);
  EXPECT_EQ(Image::create(4, 4, 5, SampleType::u8, ctx).error().code, ErrorCode::usage);
  EXPECT_EQ(Image::create(4, 4, 1, SampleType::u32, ctx).error().code, ErrorCode::usage);
  EXPECT_EQ(Image::create(int64_t{1} << 31, int64_t{1} << 31, 4, SampleType::u8, ctx).error().code,
            ErrorCode::usage);
  EXPECT_EQ(Image::create(1 << 20, 1 << 10, 4, SampleType::u8, ctx).error().code, ErrorCode::limit);
}

}  // namespace
}  // namespace voxkit
