#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "libmetrics/color_distance.h"
#include "tests/libmetrics/pictures.h"

namespace voxkit {
namespace {

using test::picture;

Lab lab_of_srgb(double r, double g, double b) {
  return lab_of_linear(srgb_to_linear(r), srgb_to_linear(g), srgb_to_linear(b));
}

TEST(ColorTest, TransferFunction) {
  EXPECT_EQ(srgb_to_linear(0), 0);
  EXPECT_EQ(srgb_to_linear(1), 1);
  EXPECT_NEAR(srgb_to_linear(0.5), 0.21404114, 1e-8);
  EXPECT_NEAR(srgb_to_linear(0.02), 0.02 / 12.92, 1e-15);
  EXPECT_NEAR(srgb_to_linear(0.04045), srgb_to_linear(0.0404500001), 1e-7);
}

TEST(ColorTest, PrimariesInLab) {
  struct {
    double r, g, b, l, a, b_star;
  } const colors[] = {{0, 0, 0, 0, 0, 0},
                      {1, 1, 1, 100, 0, 0},
                      {1, 0, 0, 53.24, 80.09, 67.20},
                      {0, 1, 0, 87.73, -86.18, 83.18},
                      {0, 0, 1, 32.30, 79.19, -107.86},
                      {1, 1, 0, 97.14, -21.55, 94.48},
                      {0.5, 0.5, 0.5, 53.39, 0, 0}};
  for (const auto& c : colors) {
    const Lab lab = lab_of_srgb(c.r, c.g, c.b);
    EXPECT_NEAR(lab.l, c.l, 0.03);
    EXPECT_NEAR(lab.a, c.a, 0.03);
    EXPECT_NEAR(lab.b, c.b_star, 0.03);
  }
}

class LabDiffTest : public testing::Test {
 protected:
  LabDiff diff(const Image& a, const Image& b, int threads = 2) {
    Context ctx{.threads = threads, .memory = &memory_};
    const auto result = diff_lab(a, b, ctx);
    EXPECT_TRUE(result) << result.error().what;
    return result ? *result : LabDiff{};
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

TEST_F(LabDiffTest, AgreesWithAPixelByPixelSum) {
  for (const SampleType type : {SampleType::u8, SampleType::u16, SampleType::f32})
    for (const int channels : {1, 3, 4}) {
      const Image a = noise(171, 103, channels, type, 1), b = noise(171, 103, channels, type, 2);
      const auto lab = [&](const Image& image, int64_t x, int64_t y) {
        double value[3];
        for (int c = 0; c < 3; ++c) {
          value[c] = image.row(y)[x * channels + (channels > 2 ? c : 0)] / image.peak();
          if (type != SampleType::f32) value[c] = srgb_to_linear(value[c]);
        }
        return lab_of_linear(value[0], value[1], value[2]);
      };
      double sum = 0, greatest = 0;
      for (int64_t y = 0; y < 103; ++y)
        for (int64_t x = 0; x < 171; ++x) {
          const Lab p = lab(a, x, y), q = lab(b, x, y);
          const double e = std::hypot(p.l - q.l, p.a - q.a, p.b - q.b);
          sum += e;
          greatest = std::max(greatest, e);
        }
      const LabDiff got = diff(a, b);
      EXPECT_NEAR(got.mean_delta_e, sum / (171 * 103), 1e-9);
      EXPECT_NEAR(got.max_delta_e, greatest, 1e-9);
    }
}

TEST_F(LabDiffTest, KnownValues) {
  const auto flat = [&](double value) {
    return picture(5, 3, 3, SampleType::u8, ctx_, [&](int64_t, int64_t, int) { return value; });
  };
  EXPECT_NEAR(diff(flat(0), flat(255)).mean_delta_e, 100, 1e-9);
  EXPECT_EQ(diff(flat(80), flat(80)).max_delta_e, 0);
}

TEST_F(LabDiffTest, SameBitsForAnyNumberOfThreads) {
  const Image a = noise(517, 391, 3, SampleType::u8, 6), b = noise(517, 391, 3, SampleType::u8, 7);
  for (const int threads : {2, 7}) EXPECT_EQ(diff(a, b, threads).mean_delta_e, diff(a, b, 1).mean_delta_e);
}

TEST_F(LabDiffTest, NoNumberIsPassedOn) {
  Image a = noise(300, 300, 3, SampleType::f32, 8);
  const Image b = noise(300, 300, 3, SampleType::f32, 9);
  a.row(2)[3] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(std::isnan(diff(a, b).mean_delta_e));
  EXPECT_TRUE(std::isnan(diff(a, b).max_delta_e));
}

TEST_F(LabDiffTest, RefusesSignedIntegersAndOtherSizes) {
  const auto flat = [&](int64_t side, SampleType type) {
    return picture(side, 3, 3, type, ctx_, [](int64_t, int64_t, int) { return -1.0; });
  };
  EXPECT_EQ(diff_lab(flat(2, SampleType::i16), flat(2, SampleType::i16), ctx_).error().code,
            ErrorCode::usage);
  EXPECT_EQ(diff_lab(flat(2, SampleType::f32), flat(3, SampleType::f32), ctx_).error().code,
            ErrorCode::usage);
}

}  // namespace
}  // namespace voxkit
