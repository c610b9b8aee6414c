// The kernel of the GPU, block by block and thread by thread, on the host.
#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "librender/cast/cast_kernel.h"
#include "librender/cast/cast_params.h"
#include "librender/cast/ray_cast.h"

namespace voxkit::render {

/// A launch: every block and thread of the grid that covers the picture, the last ones past its edge.
template <class View>
Frame launch(const View& view, const VolumeInfo& info, const Camera& camera, const CastOptions& options) {
  const auto params = cast_params(info, camera, options);
  EXPECT_TRUE(params);
  Frame frame;
  frame.width = options.width;
  frame.height = options.height;
  const size_t count = static_cast<size_t>(options.width) * static_cast<size_t>(options.height);
  frame.pixels.resize(count);
  frame.details.resize(count);
  std::vector<PixelCost> costs(count);
  const auto blocks = [](int extent, int of) { return static_cast<unsigned>((extent + of - 1) / of); };
  for (unsigned by = 0; by < blocks(options.height, block_height); ++by)
    for (unsigned bx = 0; bx < blocks(options.width, block_width); ++bx)
      for (unsigned ty = 0; ty < block_height; ++ty)
        for (unsigned tx = 0; tx < block_width; ++tx)
          cast_pixel(*params, view, {bx, by, tx, ty}, frame.pixels.data(), frame.details.data(),
                     costs.data());
  add_up(costs, frame);
  return frame;
}

}  // namespace voxkit::render
