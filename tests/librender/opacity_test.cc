// Opacity over a length against the standard library's functions.
#include "librender/cast/opacity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace voxkit::render {
namespace {

TEST(Opacity, IsThatOfTheStandardLibrary) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int i = 0; i < 200000; ++i) {
    const double a = i % 3 ? unit(random) : std::ldexp(unit(random), -static_cast<int>(random() % 50));
    const double n =
        i % 2 ? 64 * unit(random) : std::ldexp(unit(random), static_cast<int>(random() % 40) - 20);
    EXPECT_NEAR(coverage(a, n), -std::expm1(n * std::log(1 - a)), 1e-13) << a << " over " << n;
  }
  EXPECT_EQ(coverage(1, 0.001), 1);
  EXPECT_EQ(coverage(0.5, 0), 0);
  EXPECT_DOUBLE_EQ(coverage(0.5, 1), 0.5);
  EXPECT_EQ(coverage(0.999, 1e9), 1);
}

TEST(Opacity, LogarithmAndPowerAreAccurate) {
  for (int i = 1; i < 4000; ++i) {
    const double x = i / 4001.0;
    EXPECT_NEAR(log2_of_fraction(x), std::log2(x), 1e-13 * std::abs(std::log2(x)) + 1e-16) << x;
    const double y = -i * 0.27;
    EXPECT_NEAR(exp2_of_negative(y) / std::exp2(std::max(y, -1000.0)), y > -1000 ? 1 : 0, 1e-14) << y;
  }
}

}  // namespace
}  // namespace voxkit::render
