#include "libvq/brick.h"

#include <algorithm>

namespace voxkit::vq {

BrickRange range_of(const Brick& brick) {
  uint16_t min = brick[0], max = brick[0];
  for (const uint16_t v : brick) {
    min = std::min(min, v);
    max = std::max(max, v);
  }
  return {min, max};
}

}  // namespace voxkit::vq
