#include "libvq/brick.h"

#include <gtest/gtest.h>

namespace voxkit::vq {
namespace {

TEST(Brick, RangeFindsExtremesAnywhere) {
  for (size_t at = 0; at < brick_voxels; ++at) {
    Brick brick;
    brick.fill(1000);
    brick[at] = 7;
    brick[(at + 31) % brick_voxels] = 65535;
    EXPECT_EQ(range_of(brick), (BrickRange{7, 65535}));
  }
}

}  // namespace
}  // namespace voxkit::vq
