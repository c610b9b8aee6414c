// Numbers of any width, least significant bit first.
#pragma once

#include "formats/hd.h"
#include "formats/little_endian.h"

namespace voxkit::vq {

/// Readers load whole words: this many bytes behind what they are asked to read must be there to be loaded
/// (in a mapped container the chunk table and the trailer follow every chunk). What they hold does not
/// matter.
inline constexpr int read_slack = 32;

/// `count` bits, 0 to 32, from bit `at` of the bytes.
VOX_HD_HOT uint32_t load_bits(const std::byte* bytes, uint64_t at, int count) {
  const uint64_t word = load_le<uint64_t>(bytes + (at >> 3)) >> (at & 7);
  return static_cast<uint32_t>(word & ((uint64_t{1} << count) - 1));
}
/// The same to bytes that are zero there. Loads and stores 8 bytes.
inline void store_bits(std::byte* bytes, uint64_t at, uint32_t value) {
  std::byte* const p = bytes + (at >> 3);
  store_le(p, load_le<uint64_t>(p) | uint64_t{value} << (at & 7));
}

/// Eight values of `width` bits, 0 to 16, that begin at a byte.
VOX_HD_HOT void unpack8(const std::byte* bytes, int width, uint16_t* out) {
  const uint32_t mask = (1u << width) - 1;
  if (width <= 8) {
    const uint64_t word = load_le<uint64_t>(bytes);
    for (int i = 0; i < 8; ++i) out[i] = static_cast<uint16_t>(word >> (i * width) & mask);
    return;
  }
  for (int half = 0; half < 2; ++half) {
    const int at = 4 * half * width;
    const uint64_t word = load_le<uint64_t>(bytes + (at >> 3)) >> (at & 7);
    for (int i = 0; i < 4; ++i) out[4 * half + i] = static_cast<uint16_t>(word >> (i * width) & mask);
  }
}
/// The inverse: eight values of `width` bits, 0 to 16, no more, from a byte on. Stores 8 bytes, 16 for widths
/// above 8; what is behind the values becomes zero.
inline void pack8(const uint16_t* values, int width, std::byte* bytes) {
  uint64_t halves[2] = {};
  for (int i = 0; i < 4; ++i) {
    halves[0] |= uint64_t{values[i]} << (i * width);
    halves[1] |= uint64_t{values[4 + i]} << (i * width);
  }
  const int at = 4 * width;  // where the second half begins
  if (at <= 32) {
    store_le(bytes, halves[0] | halves[1] << at);
    return;
  }
  store_le(bytes, halves[0] | (at < 64 ? halves[1] << at : 0));
  store_le(bytes + 8, halves[1] >> (64 - at));
}

}  // namespace voxkit::vq
