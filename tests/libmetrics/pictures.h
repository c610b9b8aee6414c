// Pictures for the tests of image metrics.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <utility>

#include "formats/image/image.h"

namespace voxkit::test {

/// An image whose samples are sample(x, y, channel).
inline Image picture(int64_t width, int64_t height, int channels, SampleType type, Context& ctx,
                     const std::function<double(int64_t, int64_t, int)>& sample) {
  auto image = Image::create(width, height, channels, type, ctx);
  EXPECT_TRUE(image) << image.error().what;
  for (int64_t y = 0; y < height; ++y)
    for (int64_t x = 0; x < width; ++x)
      for (int c = 0; c < channels; ++c)
        image->row(y)[x * channels + c] = static_cast<float>(sample(x, y, c));
  return std::move(*image);
}

}  // namespace voxkit::test
