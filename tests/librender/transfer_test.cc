#include "librender/dvr/transfer.h"

#include <gtest/gtest.h>

#include <cmath>

namespace voxkit::render {
namespace {

TEST(Transfer, IsLinearBetweenPointsAndConstantOutside) {
  const TransferFunction f(
      {{10, {0, 0.5, 1, 0}}, {20, {1, 0.5, 0, 0.5}}, {20, {0, 0, 0, 1}}, {40, {1, 1, 1, 1}}});
  EXPECT_EQ(f(0), (std::array<double, 4>{0, 0.5, 1, 0}));
  EXPECT_EQ(f(15), (std::array<double, 4>{0.5, 0.5, 0.5, 0.25}));
  EXPECT_EQ(f(20)[3], 1);
  EXPECT_EQ(f(1e9)[3], 1);
}

TEST(Transfer, TheTableIsTheFunction) {
  const TransferFunction f({{-5, {0, 1, 0, 0}}, {7, {1, 0, 0.5, 0.9}}});
  for (int i = 0; i < TransferFunction::entries; ++i) {
    const double value = -5 + 12.0 * i / (TransferFunction::entries - 1);
    const float at = (static_cast<float>(value) - f.first()) * f.scale();
    ASSERT_EQ(static_cast<int>(at), i);
    const auto& entry = f.table()[i];
    ASSERT_NEAR(entry.rgb[0], f(value)[0], 1e-6);
    ASSERT_NEAR(1 - std::exp2(-entry.density), f(value)[3], 1e-6);
  }
  EXPECT_EQ(f.table()[0].density, 0);
}

TEST(Transfer, ShowsWhatMayBeSeen) {
  const TransferFunction f({{100, {1, 1, 1, 0}}, {110, {1, 1, 1, 1}}, {120, {1, 1, 1, 0}}});
  EXPECT_FALSE(f.shows(0, 99));
  EXPECT_FALSE(f.shows(130, 1e6f));
  EXPECT_TRUE(f.shows(0, 101));
  EXPECT_TRUE(f.shows(0, 200));
  EXPECT_TRUE(f.shows(119, 300));
  EXPECT_FALSE(f.shows(5, 4));
  EXPECT_FALSE(f.shows(NAN, NAN));
  // Wherever an entry is visible the range of its values is.
  for (float v = 90; v < 130; v += 0.01f) {
    if (f(static_cast<double>(v))[3] > 1e-3) {
      ASSERT_TRUE(f.shows(v, v)) << v;
    }
  }
}

TEST(Transfer, PresetsSpanTheRange) {
  EXPECT_FALSE(transfer_preset("none", {0, 1}));
  const auto gray = transfer_preset("gray", {1000, 3000});
  ASSERT_TRUE(gray);
  EXPECT_EQ((*gray)(1000)[3], 0);
  EXPECT_EQ((*gray)(2000)[3], 0.25);
  EXPECT_EQ((*gray)(3000)[0], 1);
  // A range of one value is a range still.
  EXPECT_GT(transfer_preset("gray", {7, 7})->span(), 0);
}

}  // namespace
}  // namespace voxkit::render
