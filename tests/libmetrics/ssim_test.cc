#include "libmetrics/ssim.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/libmetrics/pictures.h"

namespace voxkit {
namespace {

using test::picture;

// The definition, window by window, in long double.
struct Grid {
  int width = 0, height = 0;
  std::vector<long double> values;
  long double at(int x, int y) const { return values[static_cast<size_t>(y * width + x)]; }
};

Grid grid_of(const Image& image) {
  Grid grid{static_cast<int>(image.width()), static_cast<int>(image.height()), {}};
  for (int y = 0; y < grid.height; ++y)
    for (int x = 0; x < grid.width; ++x) grid.values.push_back(static_cast<long double>(image.row(y)[x]));
  return grid;
}

std::pair<long double, long double> plain_ssim(const Grid& a, const Grid& b, long double peak) {
  const int nx = std::min(a.width, 11), ny = std::min(a.height, 11);
  std::vector<long double> window;
  long double weight_sum = 0;
  for (int j = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i) {
      const long double dx = i - (nx - 1) / 2.0L, dy = j - (ny - 1) / 2.0L;
      window.push_back(std::exp(-(dx * dx + dy * dy) / (2 * 1.5L * 1.5L)));
      weight_sum += window.back();
    }
  const long double c1 = std::pow(0.01L * peak, 2), c2 = std::pow(0.03L * peak, 2);
  long double ssim = 0, contrast_structure = 0;
  int windows = 0;
  for (int y = 0; y + ny <= a.height; ++y)
    for (int x = 0; x + nx <= a.width; ++x, ++windows) {
      long double mean_a = 0, mean_b = 0, var_a = 0, var_b = 0, cov = 0;
      const auto sum = [&](auto term) {
        long double s = 0;
        for (int j = 0; j < ny; ++j)
          for (int i = 0; i < nx; ++i)
            s += window[static_cast<size_t>(j * nx + i)] / weight_sum *
                 term(a.at(x + i, y + j), b.at(x + i, y + j));
        return s;
      };
      mean_a = sum([](auto p, auto) { return p; });
      mean_b = sum([](auto, auto q) { return q; });
      var_a = sum([&](auto p, auto) { return (p - mean_a) * (p - mean_a); });
      var_b = sum([&](auto, auto q) { return (q - mean_b) * (q - mean_b); });
      cov = sum([&](auto p, auto q) { return (p - mean_a) * (q - mean_b); });
      const long double cs = (2 * cov + c2) / (var_a + var_b + c2);
      contrast_structure += cs;
      ssim += (2 * mean_a * mean_b + c1) / (mean_a * mean_a + mean_b * mean_b + c1) * cs;
    }
  return {ssim / windows, contrast_structure / windows};
}

Grid plain_half(const Grid& grid) {
  Grid half{(grid.width + 1) / 2, (grid.height + 1) / 2, {}};
  for (int y = 0; y < half.height; ++y)
    for (int x = 0; x < half.width; ++x) {
      const int x1 = std::min(2 * x + 1, grid.width - 1), y1 = std::min(2 * y + 1, grid.height - 1);
      half.values.push_back(
          (grid.at(2 * x, 2 * y) + grid.at(x1, 2 * y) + grid.at(2 * x, y1) + grid.at(x1, y1)) / 4);
    }
  return half;
}

Ssim plain(const Image& image_a, const Image& image_b, double peak) {
  Grid a = grid_of(image_a), b = grid_of(image_b);
  const long double weights[] = {0.0448L, 0.2856L, 0.3001L, 0.2363L, 0.1333L};
  Ssim result;
  const int side = std::min(a.width, a.height);
  for (int scales = 1; scales <= 5; ++scales)
    if (scales == 1 || 11 * std::pow(2, scales - 1) <= side) result.scales = scales;
  long double weight_sum = 0, product = 1;
  for (int s = 0; s < result.scales; ++s) weight_sum += weights[s];
  for (int s = 0; s < result.scales; ++s) {
    if (s > 0) a = plain_half(a), b = plain_half(b);
    const auto [ssim, cs] = plain_ssim(a, b, static_cast<long double>(peak));
    if (s == 0) result.ssim = static_cast<double>(ssim);
    product *= std::pow(std::max(s + 1 < result.scales ? cs : ssim, 0.0L), weights[s] / weight_sum);
  }
  result.ms_ssim = static_cast<double>(product);
  return result;
}

class SsimTest : public testing::Test {
 protected:
  Ssim measure(const Image& a, const Image& b, int threads = 2, std::optional<double> peak = {}) {
    Context ctx{.threads = threads, .memory = &memory_};
    const auto result = ssim(a, b, peak, ctx);
    EXPECT_TRUE(result) << result.error().what;
    return result ? *result : Ssim{};
  }
  void expect_plain(const Image& a, const Image& b, int scales) {
    const Ssim expected = plain(a, b, a.peak()), got = measure(a, b);
    EXPECT_EQ(got.scales, scales);
    EXPECT_EQ(expected.scales, scales);
    EXPECT_NEAR(got.ssim, expected.ssim, 1e-6);
    EXPECT_NEAR(got.ms_ssim, expected.ms_ssim, 1e-6);
  }
  Image smooth(int64_t width, int64_t height, SampleType type, double phase = 0) {
    return picture(width, height, 1, type, ctx_, [&](int64_t x, int64_t y, int) {
      const auto fx = static_cast<double>(x), fy = static_cast<double>(y);
      const double v = 0.5 + 0.3 * std::sin(fx / 9 + phase) + 0.2 * std::cos(fy / 5 - phase);
      return type == SampleType::f32 ? v : std::round(v * (type == SampleType::u8 ? 255 : 65535));
    });
  }
  Image noise(int64_t width, int64_t height, unsigned seed) {
    std::mt19937 random(seed);
    return picture(width, height, 1, SampleType::u8, ctx_,
                   [&](int64_t, int64_t, int) { return static_cast<double>(random() % 256); });
  }
  Image constant(int64_t width, int64_t height, double value) {
    return picture(width, height, 1, SampleType::u8, ctx_, [&](int64_t, int64_t, int) { return value; });
  }

  MemoryBudget memory_{1 << 26};
  Context ctx_{.threads = 2, .memory = &memory_};
};

TEST_F(SsimTest, AgreesWithTheDefinitionAtEverySize) {
  struct {
    int64_t width, height;
    int scales;
  } const sizes[] = {{177, 191, 5}, {176, 176, 5}, {175, 200, 4}, {300, 87, 3}, {44, 45, 3},
                     {22, 23, 2},   {21, 300, 1},  {11, 11, 1},   {12, 11, 1},  {5, 7, 1},
                     {7, 40, 1},    {10, 10, 1},   {1, 1, 1},     {1, 13, 1},   {200, 1, 1}};
  for (const auto& size : sizes) {
    SCOPED_TRACE(testing::Message() << size.width << " x " << size.height);
    expect_plain(smooth(size.width, size.height, SampleType::u8),
                 smooth(size.width, size.height, SampleType::u8, 0.2), size.scales);
    expect_plain(noise(size.width, size.height, 1), noise(size.width, size.height, 2), size.scales);
  }
}

TEST_F(SsimTest, AgreesWithTheDefinitionAtEveryDepth) {
  expect_plain(smooth(180, 177, SampleType::u16), smooth(180, 177, SampleType::u16, 0.1), 5);
  expect_plain(smooth(180, 177, SampleType::f32), smooth(180, 177, SampleType::f32, 0.1), 5);
  // Values far from zero whose variance is small: cancellation.
  const auto bright = [&](unsigned seed) {
    std::mt19937 random(seed);
    return picture(180, 177, 1, SampleType::u16, ctx_,
                   [&](int64_t, int64_t, int) { return 65500 + static_cast<double>(random() % 3); });
  };
  expect_plain(bright(1), bright(2), 5);
}

TEST_F(SsimTest, SmoothPictureWithNoise) {
  std::mt19937 random(7);
  const Image a = smooth(190, 180, SampleType::u8);
  const Image b = picture(190, 180, 1, SampleType::u8, ctx_, [&](int64_t x, int64_t y, int) {
    return std::clamp(static_cast<double>(a.row(y)[x]) + static_cast<double>(random() % 41) - 20, 0.0, 255.0);
  });
  expect_plain(a, b, 5);
}

TEST_F(SsimTest, Constants) {
  expect_plain(constant(176, 180, 10), constant(176, 180, 200), 5);
  // Nothing but luminance differs, which counts at the last scale only.
  const double c1 = 2.55 * 2.55, l = (2 * 10 * 200 + c1) / (10 * 10 + 200 * 200 + c1);
  const Ssim got = measure(constant(176, 180, 10), constant(176, 180, 200));
  EXPECT_NEAR(got.ssim, l, 1e-9);
  EXPECT_NEAR(got.ms_ssim, std::pow(l, 0.1333 / 1.0001), 1e-9);
}

TEST_F(SsimTest, EqualImagesAreOneExactly) {
  for (const int64_t side : {1, 5, 11, 100, 177, 400}) {
    for (const Image& image : {noise(side, side + 3, 3), smooth(side, side + 3, SampleType::f32),
                               smooth(side + 9, side, SampleType::u16), constant(side, side, 255)}) {
      const Ssim got = measure(image, image);
      EXPECT_EQ(got.ssim, 1) << side;
      EXPECT_EQ(got.ms_ssim, 1) << side;
    }
  }
  // Samples so large that rounding hides their variance.
  std::mt19937 random(5);
  const Image huge = picture(180, 180, 1, SampleType::f32, ctx_, [&](int64_t, int64_t, int) {
    return 1e15 + 1e8 * static_cast<double>(random() % 4);
  });
  EXPECT_EQ(measure(huge, huge).ms_ssim, 1);
}

TEST_F(SsimTest, StaysInItsRangeWhereRoundingIsLargerThanTheVariance) {
  for (const double value : {1e15, 1.7e15, 3e20}) {
    const auto flat = [&](double factor) {
      return picture(180, 180, 1, SampleType::f32, ctx_,
                     [&](int64_t, int64_t, int) { return value * factor; });
    };
    const Ssim got = measure(flat(1), flat(1.37));
    EXPECT_LE(std::abs(got.ssim), 1) << value;
    EXPECT_LE(got.ms_ssim, 1) << value;
  }
}

TEST_F(SsimTest, NegativeTermsCountAsZero) {
  const Image a = noise(200, 200, 4);
  const Image b = picture(200, 200, 1, SampleType::u8, ctx_,
                          [&](int64_t x, int64_t y, int) { return 255 - a.row(y)[x]; });
  EXPECT_LT(measure(a, b).ssim, -0.5);
  EXPECT_EQ(measure(a, b).ms_ssim, 0);
}

TEST_F(SsimTest, SameBitsForAnyNumberOfThreads) {
  const Image a = noise(517, 391, 8), b = smooth(517, 391, SampleType::u8);
  const Ssim one = measure(a, b, 1);
  for (const int threads : {2, 7}) {
    const Ssim many = measure(a, b, threads);
    EXPECT_EQ(one.ssim, many.ssim);
    EXPECT_EQ(one.ms_ssim, many.ms_ssim);
  }
}

TEST_F(SsimTest, Symmetric) {
  const Image a = noise(180, 190, 8), b = smooth(180, 190, SampleType::u8);
  EXPECT_EQ(measure(a, b).ms_ssim, measure(b, a).ms_ssim);
}

TEST_F(SsimTest, NoNumberIsPassedOn) {
  Image a = smooth(40, 40, SampleType::f32);
  const Image b = smooth(40, 40, SampleType::f32, 0.1);
  for (const float wrong :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    a.row(20)[20] = wrong;
    EXPECT_TRUE(std::isnan(measure(a, b).ssim));
    EXPECT_TRUE(std::isnan(measure(a, b).ms_ssim));
  }
}

TEST_F(SsimTest, PeakIsTheCallers) {
  const Image a = smooth(60, 60, SampleType::u8), b = smooth(60, 60, SampleType::u8, 0.3);
  EXPECT_NEAR(measure(a, b, 2, 1000).ssim, plain(a, b, 1000).ssim, 1e-9);
  EXPECT_NE(measure(a, b, 2, 1000).ssim, measure(a, b).ssim);
}

TEST_F(SsimTest, Refuses) {
  const Image a = noise(20, 20, 1), other = noise(20, 21, 1), wide = smooth(20, 20, SampleType::u16);
  EXPECT_EQ(ssim(a, other, {}, ctx_).error().code, ErrorCode::usage);
  EXPECT_EQ(ssim(a, wide, {}, ctx_).error().code, ErrorCode::usage);
  EXPECT_EQ(channel(a, 1, ctx_).error().code, ErrorCode::usage);
  MemoryBudget small(2000);
  Context tight{.threads = 1, .memory = &small};
  EXPECT_EQ(luma(noise(100, 100, 1), tight).error().code, ErrorCode::limit);
}

TEST_F(SsimTest, LumaAndChannels) {
  const Image color = picture(9, 4, 4, SampleType::u8, ctx_, [](int64_t x, int64_t y, int c) {
    return static_cast<double>(7 * x + 30 * y + 11 * c);
  });
  const auto grey = luma(color, ctx_), green = channel(color, 1, ctx_), alpha = channel(color, 3, ctx_);
  ASSERT_TRUE(grey && green && alpha);
  for (int64_t y = 0; y < 4; ++y)
    for (int64_t x = 0; x < 9; ++x) {
      const double r = static_cast<double>(7 * x + 30 * y);
      EXPECT_NEAR(grey->row(y)[x], r + 0.7152 * 11 + 0.0722 * 22, 1e-4);
      EXPECT_EQ(green->row(y)[x], static_cast<float>(r + 11));
      EXPECT_EQ(alpha->row(y)[x], static_cast<float>(r + 33));
    }
  const Image white = picture(3, 3, 3, SampleType::u8, ctx_, [](int64_t, int64_t, int) { return 255.0; });
  EXPECT_EQ(luma(white, ctx_)->row(1)[1], 255);
}

TEST(Ssim, OfLargeConstantsIsThatOfTheirLuminance) {
  MemoryBudget budget;
  Context ctx;
  ctx.memory = &budget;
  for (const double value : {1e4, 1e8, 1e20, 1e38})
    for (const double ratio : {1.0, 1.5, -1.0}) {
      const auto flat = [&](double v) {
        return picture(40, 30, 1, SampleType::f32, ctx, [&](int64_t, int64_t, int) { return v; });
      };
      const Image a = flat(value), b = flat(value * ratio);
      const double va = a.row(0)[0], vb = b.row(0)[0], c1 = 0.01 * 0.01;
      EXPECT_NEAR(ssim(a, b, std::nullopt, ctx)->ssim, (2 * va * vb + c1) / (va * va + vb * vb + c1), 1e-12)
          << value << ' ' << ratio;
    }
}

}  // namespace
}  // namespace voxkit
