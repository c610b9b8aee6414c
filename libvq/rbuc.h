// Codewords: a brick in a variable number of bytes, by recursive bottom up complete coding (RBUC; Moffat and
// Anh 2005) of two levels of 8, as Guthe and Goesele 2016, section 3.1, describe it.
//
// A codeword is c2 | transform << 6; the widths c1(0) .. c1(7) in c2 bits each; then for each of the eight
// 2^3 octants its eight residuals in c1 bits each. Every part begins at a byte. A first byte of 255 says that
// the voxels follow as they are. Bits: FORMAT.md, section 3.5.
#pragma once

#include <span>

#include "libvq/bits.h"
#include "libvq/transform.h"

namespace voxkit::vq {

/// The longest codeword that `encode_codeword` makes, of 16 bit voxels; the store behind it is written, too.
inline constexpr int longest_codeword = 1 + 5 + 8 * 16;
/// First byte of a codeword that holds plain voxels.
inline constexpr uint8_t escape = 255;
/// Bytes of 64 voxels of `bits` bits.
constexpr int plain_bytes(int bits) {
  return 8 * bits;
}

/// Where voxel i = 4z + 2y + x of octant 4Z + 2Y + X is in raster order.
VOX_HD_HOT uint32_t octant_voxel(uint32_t octant, uint32_t i) {
  return (2 * (octant & 1) + (i & 1)) + 4 * ((octant & 2) + (i >> 1 & 1)) +
         16 * ((octant >> 1 & 2) + (i >> 2));
}

/// Codes a brick with range.min < range.max, in whichever transform takes the fewest bytes (of equals the
/// first), never with an escape; `bytes` has room for longest_codeword + 8. Depends on the voxels'
/// differences only. Returns the length.
int encode_codeword(const Brick& brick, BrickRange range, std::byte* bytes);
/// The transform of a codeword; it must not be an escape.
inline Transform transform_of(const std::byte* codeword) {
  return static_cast<Transform>(std::to_integer<int>(*codeword) >> 6);
}
/// Writes 64 voxels, less `base`, of `bits` bits; `bytes` has room for plain_bytes(bits) + 8, all zero.
void encode_plain(const Brick& brick, uint32_t base, int bits, std::byte* bytes);

/// 64 voxels of `bits` bits, as they are; false unless all lie in the range. Reads plain_bytes(bits) and
/// read_slack.
bool decode_plain(const std::byte* bytes, int bits, BrickRange range, uint16_t* voxels);
/// Decodes a codeword of a brick with range.min < range.max to 64 voxels in raster order. `bits`: of plain
/// voxels, should the codeword hold those. False if it is not valid or would take more than `available` >= 1
/// bytes; then the voxels mean nothing. Reads `available` bytes and read_slack. Uses AVX2 where that is; the
/// results are the same without.
bool decode_codeword(const std::byte* codeword, uint32_t available, int bits, BrickRange range,
                     uint16_t* voxels);
/// Length of a valid codeword, 0 if it is not valid or longer than `available`.
int codeword_length(const std::byte* codeword, uint32_t available, int bits);

/// The same two for any machine.
VOX_HD_HOT bool decode_plain_portable(const std::byte* bytes, int bits, BrickRange range, uint16_t* voxels) {
  bool inside = true;
  for (int row = 0; row < 8; ++row) {
    unpack8(bytes + row * bits, bits, voxels + 8 * row);
    for (int i = 0; i < 8; ++i)
      inside &= voxels[8 * row + i] >= range.min && voxels[8 * row + i] <= range.max;
  }
  return inside;
}
VOX_HD_HOT bool decode_codeword_portable(const std::byte* codeword, uint32_t available, int bits,
                                         BrickRange range, uint16_t* voxels) {
  const auto head = static_cast<uint32_t>(codeword[0]);
  if (head == escape)
    return available > static_cast<uint32_t>(plain_bytes(bits)) &&
           decode_plain_portable(codeword + 1, bits, range, voxels);
  const uint32_t c2 = head & 63, top = static_cast<uint32_t>(range.max - range.min);
  if (c2 > 5) return false;
  const uint64_t widths = load_le<uint64_t>(codeword + 1);
  uint32_t at = 1 + c2;
  bool valid = true;
  for (uint32_t octant = 0; octant < 8; ++octant) {
    const auto c1 = static_cast<uint32_t>(widths >> (octant * c2) & ((1u << c2) - 1));
    if (c1 > 16 || at + c1 > available) return false;
    uint16_t values[8];
    unpack8(codeword + at, static_cast<int>(c1), values);
    for (uint32_t i = 0; i < 8; ++i) {
      valid &= values[i] <= top;
      voxels[octant_voxel(octant, i)] = values[i];
    }
    at += c1;
  }
  if (!valid) return false;
  invert(static_cast<Transform>(head >> 6), voxels, top);
  for (int i = 0; i < brick_voxels; ++i) voxels[i] = static_cast<uint16_t>(voxels[i] + range.min);
  return true;
}

}  // namespace voxkit::vq
