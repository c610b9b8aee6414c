// The powers and roots of formats/lab.cc against those of the C library.
#include "formats/lab.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace voxkit {
namespace {

TEST(Lab, LinearLightIsThePowerThatTheStandardSays) {
  for (int i = 0; i <= 65535; ++i) {
    const double stored = i / 65535.0;
    const double expected = stored <= 0.04045 ? stored / 12.92 : std::pow((stored + 0.055) / 1.055, 2.4);
    ASSERT_NEAR(srgb_to_linear(stored), expected, 4e-15 * expected);
  }
  EXPECT_EQ(srgb_to_linear(1), 1);
}

TEST(Lab, TheCurveIsACubeRootAboveItsKnee) {
  for (double light = 0.00886; light < 1e6; light *= 1.0007)
    ASSERT_NEAR(lab_curve(light), std::cbrt(light), 1e-15 * std::cbrt(light)) << light;
  for (double light = -2; light < 0.00885; light += 1e-5)
    ASSERT_NEAR(lab_curve(light), light * 841 / 108 + 4.0 / 29, 1e-13);
  // Both parts and their slopes meet.
  const double knee = 216.0 / 24389;
  EXPECT_NEAR(lab_curve(knee * (1 + 1e-9)) - lab_curve(knee * (1 - 1e-9)), knee * 2e-9 * 841 / 108, 1e-13);
  EXPECT_TRUE(std::isnan(lab_curve(std::numeric_limits<double>::quiet_NaN())));
  EXPECT_TRUE(std::isinf(lab_curve(std::numeric_limits<double>::infinity())));
}

}  // namespace
}  // namespace voxkit
