// Thresholds in CIELAB: the fast conversion is as exact as it says, and the bound holds.
#include "formats/lab.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libcolor/blocks/block_encode.h"
#include "libcolor/blocks/block_kernel.h"
#include "libcolor/blocks/lab_colors.h"
#include "tests/libcolor/color_runs.h"

namespace voxkit::color {
namespace {

Lab lab_of(Rgb c) {
  return lab_of_linear(srgb_to_linear(c.r / 255.0), srgb_to_linear(c.g / 255.0), srgb_to_linear(c.b / 255.0));
}
double distance(const LabPoint& p, const LabPoint& q) {
  double sum = 0;
  for (size_t i = 0; i < 3; ++i) sum += std::pow(static_cast<double>(p[i]) - q[i], 2);
  return std::sqrt(sum) / lab_scale;
}

TEST(ColorLab, PointsAreAsExactAsTheySay) {
  // 5 and 256 have no common factor: the dark colours, near the knee of the curve, are among these.
  double worst = 0;
  for (uint32_t code = 0; code < 1u << 24; code += code < 1u << 16 ? 1 : 5) {
    const Rgb c{static_cast<uint8_t>(code >> 16), static_cast<uint8_t>(code >> 8),
                static_cast<uint8_t>(code)};
    const Lab lab = lab_of(c);
    const LabPoint point = lab_colors().point(c);
    worst = std::max(worst, std::hypot(point[0] / lab_scale - lab.l, point[1] / lab_scale - lab.a,
                                       point[2] / lab_scale - lab.b));
  }
  EXPECT_LT(2 * worst, lab_precision);
}

TEST(ColorLab, WorstRoundingTo565) {
  const auto rounded = [](uint32_t v, uint32_t most) { return (v * most * 2 + 255) / 510; };
  double worst = 0;
  for (uint32_t code = 0; code < 1u << 24; ++code) {
    const Rgb c{static_cast<uint8_t>(code >> 16), static_cast<uint8_t>(code >> 8),
                static_cast<uint8_t>(code)};
    const Rgb ends{from_5_bits(rounded(c.r, 31)), from_6_bits(rounded(c.g, 63)),
                   from_5_bits(rounded(c.b, 31))};
    const LabPoint p = lab_colors().point(c), q = lab_colors().point(ends);
    const float l = p[0] - q[0], a = p[1] - q[1], b = p[2] - q[2];
    worst = std::max(worst, static_cast<double>(l * l + a * a + b * b));
  }
  EXPECT_LT(std::sqrt(worst) / lab_scale + 2 * lab_precision, 5.33);
  EXPECT_EQ(endpoints_for(5.33, ErrorSpace::lab), Endpoints::rgb565);
  EXPECT_EQ(endpoints_for(5.32, ErrorSpace::lab), Endpoints::rgb888);
}

TEST(ColorLab, KernelsFindTheNearest) {
  for (const ColorCase& c : color_cases(1100, 3)) {
    std::array<std::vector<float>, 3> channels;
    for (auto& channel : channels) channel.resize(c.colors.size() + 8);
    for (size_t i = 0; i < c.colors.size(); ++i)
      for (size_t k = 0; k < 3; ++k) channels[k][i] = lab_colors().point(c.colors[i])[k];
    for (const uint32_t size : {1u, 7u, 64u, 65u, 1100u})
      for (const int count : {1, 2, 16}) {
        const ColorRun run{{channels[0].data(), channels[1].data(), channels[2].data()}, size};
        std::array<LabPoint, 16> steps;
        for (size_t k = 0; k < steps.size(); ++k) steps[k] = lab_colors().point(c.colors[k * 60]);
        std::vector<uint8_t> plain(size + 8), native(size + 8);
        constexpr uint32_t all = 1u << 31;
        const Distances p = block_kernels(false).nearest(run, steps.data(), count, all, plain.data());
        const Distances n = block_kernels(true).nearest(run, steps.data(), count, all, native.data());
        EXPECT_EQ(p.most, n.most);
        EXPECT_EQ(p.sum, n.sum);
        EXPECT_EQ(plain, native);
        double furthest = 0;
        for (uint32_t i = 0; i < size; ++i) {
          const LabPoint point = {channels[0][i], channels[1][i], channels[2][i]};
          double least = 1e9;
          for (int k = 0; k < count; ++k)
            least = std::min(least, distance(point, steps[static_cast<size_t>(k)]));
          furthest = std::max(furthest, least);
          ASSERT_NEAR(distance(point, steps[plain[i]]), least, 1e-3);
        }
        EXPECT_NEAR(std::sqrt(p.most) / lab_scale, furthest, 1.0 / lab_scale);
        EXPECT_GE(p.most, furthest * furthest * lab_scale * lab_scale * (1 - 1e-6));
        // Ends early where one is further than allowed.
        if (p.most > 1) {
          EXPECT_GT(block_kernels(true).nearest(run, steps.data(), count, p.most / 2, nullptr).most,
                    p.most / 2);
        }
      }
  }
}

TEST(ColorLab, NoColorIsFurtherThanTheThreshold) {
  for (const double threshold : {0.0, 0.3, 1.0, 2.3, 5.32, 5.33, 10.0, 40.0, 1000.0})
    for (const auto& [weight_bits, effort] : {std::pair(0, 1), {0, 4}, {1, 3}, {3, 3}, {4, 3}})
      for (const ColorCase& c : color_cases(2500, 1)) {
        SCOPED_TRACE(testing::Message() << c.name << ", " << threshold << ", " << weight_bits << " bits");
        const BlockOptions options{threshold, weight_bits, effort, ErrorSpace::lab};
        const EncodedPart part = encode_part(c.colors, options);
        const PartView view(part.bytes.data(), part.bytes.size(), static_cast<uint32_t>(c.colors.size()),
                            endpoints_for(threshold, ErrorSpace::lab));
        ASSERT_TRUE(view.valid());
        uint64_t squares = 0;
        double most = 0;
        for (size_t i = 0; i < c.colors.size(); ++i) {
          const Rgb was = c.colors[i], is = view.color(static_cast<uint32_t>(i));
          if (was != is) most = std::max(most, delta_e(lab_of(was), lab_of(is)));
          const int r = was.r - is.r, g = was.g - is.g, b = was.b - is.b;
          squares += static_cast<uint64_t>(r * r + g * g + b * b);
        }
        EXPECT_LE(most, threshold);
        EXPECT_EQ(squares, part.squared_error);
        EXPECT_NEAR(std::sqrt(part.most_squared) / lab_scale, most, 1.5 / lab_scale);
      }
}

TEST(ColorLab, MoreIsSmaller) {
  for (const ColorCase& c : color_cases(20000, 2)) {
    if (c.name != "walk" && c.name != "patches" && c.name != "gradient") continue;
    const auto size = [&](double threshold) {
      return encode_part(c.colors, {threshold, 0, 3, ErrorSpace::lab}).bytes.size();
    };
    EXPECT_LT(size(2.3), size(1) * 4 / 5) << c.name;
    EXPECT_LT(size(8), size(2.3) * 4 / 5) << c.name;
  }
}

}  // namespace
}  // namespace voxkit::color
