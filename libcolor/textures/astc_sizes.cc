// The sizes of ASTC's blocks.
#include <algorithm>
#include <array>

#include "libcolor/textures/astc.h"

namespace voxkit::color {
namespace {

constexpr std::array<BlockSize, 14> sizes = {{{4, 4},
                                              {5, 4},
                                              {5, 5},
                                              {6, 5},
                                              {6, 6},
                                              {8, 5},
                                              {8, 6},
                                              {10, 5},
                                              {10, 6},
                                              {8, 8},
                                              {10, 8},
                                              {10, 10},
                                              {12, 10},
                                              {12, 12}}};

}  // namespace

std::span<const BlockSize> astc_block_sizes() {
  return sizes;
}

BlockSize astc_block_size(int quality) {
  constexpr int last = static_cast<int>(sizes.size()) - 1;
  return sizes[static_cast<size_t>(((100 - std::clamp(quality, 0, 100)) * last + 50) / 100)];
}

}  // namespace voxkit::color
