// Fill values and NaN come back exactly beside any error bound; a looser bound never takes more bytes.
#include <gtest/gtest.h>

#include <cmath>

#include "libvq/error_step.h"
#include "tests/libvq/attack.h"
#include "tests/libvq/volumes.h"

namespace voxkit::vq {
namespace {

using namespace voxkit::vq::test;
using voxkit::test::ForwardSource;
using voxkit::test::MemorySource;
using voxkit::test::scalar_info;

TEST(VqFill, NanComesBackBesideAnErrorBound) {
  const VolumeInfo info = scalar_info({19, 14, 7}, SampleType::f32);
  std::vector<float> values(19 * 14 * 7);
  for (size_t i = 0; i < values.size(); ++i)
    values[i] = i % 5 == 0 ? std::nanf("") : std::sin(static_cast<float>(i));
  std::vector<std::byte> voxels(values.size() * 4);
  std::memcpy(voxels.data(), values.data(), voxels.size());
  for (const bool bounded : {false, true}) {
    Options options;
    options.range = {-1, 1};
    options.keep_nan = true;
    if (bounded) options.max_error = 0.125;
    const Encoded encoded = encode_to_memory(info, voxels, options);
    EXPECT_FALSE(encoded.report.replaced);
    ASSERT_TRUE(encoded.report.params.special);
    const Answer answer = attack(encoded.bytes);
    EXPECT_EQ(answer.fault, "");
    ASSERT_TRUE(answer.voxels);
    for (size_t i = 0; i < values.size(); ++i) {
      float decoded;
      std::memcpy(&decoded, answer.voxels->data() + 4 * i, 4);
      if (std::isnan(values[i])) {
        ASSERT_TRUE(std::isnan(decoded)) << i;
      } else {
        ASSERT_LE(std::abs(decoded - values[i]), encoded.report.params.max_error) << i;
      }
    }
  }
}

TEST(VqFill, TheFillValueOfIntegersIsExact) {
  for (const double fill : {0.0, 77.0, 65535.0}) {
    VolumeInfo info = scalar_info({21, 9, 6}, SampleType::u16);
    info.fill = fill;
    auto voxels = make_voxels(info, Content::noise, 12, 5);
    for (size_t i = 0; i < voxels.size(); i += 14) {
      const auto value = static_cast<uint16_t>(fill);
      std::memcpy(&voxels[i], &value, 2);
    }
    Options options;
    options.max_error = 100;
    const Encoded encoded = encode_to_memory(info, voxels, options);
    const Answer answer = attack(encoded.bytes);
    EXPECT_EQ(answer.fault, "");
    ASSERT_TRUE(answer.voxels);
    for (size_t i = 0; i < voxels.size(); i += 2) {
      uint16_t before, after;
      std::memcpy(&before, &voxels[i], 2);
      std::memcpy(&after, answer.voxels->data() + i, 2);
      if (before == fill) {
        ASSERT_EQ(after, before);
      }
      ASSERT_LE(std::abs(before - after), 100);
    }
    options.max_error.reset();
    options.reduce = 2;
    EXPECT_FALSE(validate(options, info));
  }
}

TEST(VqErrorStep, ALooserBoundNeverTakesMoreBytes) {
  for (const SampleType type : {SampleType::u8, SampleType::u16}) {
    const VolumeInfo info = scalar_info({40, 40, 24}, type);
    const auto voxels = make_voxels(info, Content::noise, type == SampleType::u8 ? 7 : 11, 9);
    Context ctx;
    MemoryBudget budget;
    ctx.memory = &budget;
    size_t before = ~size_t{0};
    for (double error = 1; error <= 200; error += error < 40 ? 1 : 17) {
      Options options;
      MemorySource source(info, voxels);
      const auto step = smallest_error_step(source, error, options, ctx);
      ASSERT_TRUE(step);
      ASSERT_LE(*step, error);
      ASSERT_GT(*step, 0);
      ForwardSource forward(info, voxels);
      ASSERT_EQ(*smallest_error_step(forward, error, options, ctx), *step);
      options.max_error = *step;
      const Encoded encoded = encode_to_memory(info, voxels, options);
      EXPECT_LE(encoded.bytes.size(), before) << error;
      before = encoded.bytes.size();
    }
  }
}

}  // namespace
}  // namespace voxkit::vq
