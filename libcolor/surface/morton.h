// Morton codes of voxels: the bits of x, y and z interleaved, x lowest.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

#include "formats/hd.h"

namespace voxkit::color {

/// Spreads 21 bits: bit i goes to bit 3i.
VOX_HD constexpr uint64_t spread_bits(uint64_t v) {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x1f00000000ffffu;
  v = (v | v << 16) & 0x1f0000ff0000ffu;
  v = (v | v << 8) & 0x100f00f00f00f00fu;
  v = (v | v << 4) & 0x10c30c30c30c30c3u;
  return (v | v << 2) & 0x1249249249249249u;
}
/// The inverse: bit 3i goes to bit i.
VOX_HD constexpr uint32_t gather_bits(uint64_t v) {
  v &= 0x1249249249249249u;
  v = (v | v >> 2) & 0x10c30c30c30c30c3u;
  v = (v | v >> 4) & 0x100f00f00f00f00fu;
  v = (v | v >> 8) & 0x1f0000ff0000ffu;
  v = (v | v >> 16) & 0x1f00000000ffffu;
  return static_cast<uint32_t>(v | v >> 32) & 0x1fffff;
}

VOX_HD constexpr uint64_t morton_code(uint32_t x, uint32_t y, uint32_t z) {
  return spread_bits(x) | spread_bits(y) << 1 | spread_bits(z) << 2;
}
VOX_HD inline glm::uvec3 morton_place(uint64_t code) {
  return {gather_bits(code), gather_bits(code >> 1), gather_bits(code >> 2)};
}

}  // namespace voxkit::color
