// The bits of a level: sizes of blocks, words and links, and the 'SVMP' chunk (FORMAT.md, section 2).
#pragma once

#include <bit>
#include <span>
#include <vector>

#include "formats/little_endian.h"
#include "libsvmm/svmm.h"

namespace voxkit::svmm {

inline constexpr uint32_t params_kind = chunk_kind("SVMP");
inline constexpr uint32_t blocks_kind = chunk_kind("BLKS");

/// load_le from where a T may lie: devices load it as one word then, not byte by byte.
template <class T>
VOX_HD T load_aligned_le(const std::byte* p) {
#ifdef __CUDA_ARCH__
  return *reinterpret_cast<const T*>(p);
#else
  return load_le<T>(p);
#endif
}

/// A subblock is 2^3 voxels; voxel i = 4z + 2y + x (section 2.2.2). Of a block of `size` voxels (all even)
/// the subblocks follow in raster order, x fastest, 8 voxels each.
constexpr int64_t subblock_index(Index3 v, Index3 size) {
  return ((v.z >> 1) * (size.y >> 1) + (v.y >> 1)) * (size.x >> 1) + (v.x >> 1);
}
constexpr int voxel_in_subblock(Index3 v) {
  return static_cast<int>((v.z & 1) * 4 + (v.y & 1) * 2 + (v.x & 1));
}
constexpr int64_t voxel_index(Index3 v, Index3 size) {
  return subblock_index(v, size) * 8 + voxel_in_subblock(v);
}

/// Bytes of a value above the base level in layout plain: those of the format; BITMAP has its coverage,
/// 0..255.
constexpr int value_bytes(VoxelFormat f) {
  return voxel_bytes(f);
}
/// Bytes of a structural word in layout thesis.
constexpr int word_bytes(VoxelFormat f) {
  return is_color(f) ? 4 : 2;
}

/// The children of a subblock: which of its voxels are not terminal, and the index of the first one's block
/// in the level below; those of the others follow it.
struct Link {
  uint64_t first = 0;  ///< below 2^56 (plain) or 2^32 (thesis)
  uint8_t mask = 0;    ///< bit i: voxel i has a block
  /// Block of non-terminal voxel i: first plus the number of non-terminal voxels before it.
  VOX_HD uint64_t child(int i) const {
    return first + static_cast<unsigned>(std::popcount(mask & ((1u << i) - 1u)));
  }
  int children() const { return std::popcount(mask); }
};

/// Layout plain: a link is 64 bits, mask in the top eight.
inline uint64_t pack_link(Link link) {
  return link.first | uint64_t{link.mask} << 56;
}
VOX_HD inline Link unpack_link(uint64_t bits) {
  return {bits & ((uint64_t{1} << 56) - 1), static_cast<uint8_t>(bits >> 56)};
}

/// Layout thesis, Table 2.1: terminal flag in bit 4 and the i-th four bits of the offset in bits 3..0 of the
/// i-th word.
constexpr int alpha_to_3_bits(int alpha) {
  return (alpha * 7 * 2 + 255) / 510;
}
constexpr int alpha_from_3_bits(int bits) {
  return (bits * 255 * 2 + 7) / 14;
}
inline uint32_t thesis_word(const Voxel& value, VoxelFormat f, Link link, int i) {
  const uint32_t structure =
      (link.mask >> i & 1u ? 0u : 16u) | static_cast<uint32_t>(link.first >> (4 * i) & 15u);
  const auto byte = [&](int k) { return std::to_integer<uint32_t>(value.bytes[static_cast<size_t>(k)]); };
  if (f == VoxelFormat::density8) return byte(0) << 8 | structure;
  const int alpha = f == VoxelFormat::rgb24 ? 255 : static_cast<int>(byte(3));
  return byte(0) << 24 | byte(1) << 16 | byte(2) << 8 | static_cast<uint32_t>(alpha_to_3_bits(alpha)) << 5 |
         structure;
}
VOX_HD inline Voxel thesis_value(uint32_t word, VoxelFormat f) {
  Voxel v;
  if (f == VoxelFormat::density8) {
    v.bytes[0] = static_cast<std::byte>(word >> 8);
    return v;
  }
  for (int k = 0; k < 3; ++k) v.bytes[static_cast<size_t>(k)] = static_cast<std::byte>(word >> (24 - 8 * k));
  if (f == VoxelFormat::rgba32) v.bytes[3] = static_cast<std::byte>(alpha_from_3_bits(word >> 5 & 7));
  return v;
}
VOX_HD inline uint32_t load_word(const std::byte* p, VoxelFormat f) {
  return is_color(f) ? load_aligned_le<uint32_t>(p) : load_aligned_le<uint16_t>(p);
}
inline void store_word(std::byte* p, VoxelFormat f, uint32_t word) {
  is_color(f) ? store_le(p, word) : store_le(p, static_cast<uint16_t>(word));
}

/// Bytes of the values of a subblock, layout plain; the links of a block follow those of all.
constexpr int subblock_bytes(VoxelFormat f) {
  return 8 * value_bytes(f);
}
// Values, links and words lie at multiples of their size within a block, and so do blocks that follow each
// other from such a place on.
static_assert([] {
  for (const VoxelFormat f : {VoxelFormat::rgba32, VoxelFormat::rgb24, VoxelFormat::density8,
                              VoxelFormat::density16, VoxelFormat::float32, VoxelFormat::bitmap})
    if (subblock_bytes(f) % static_cast<int>(sizeof(uint64_t)) != 0 || 8 * word_bytes(f) % 8 != 0)
      return false;
  return true;
}());

/// A block above the base level, or a root, of `size` voxels. Its bytes must be at least
/// `structural_block_bytes`; they begin at a multiple of 8, where a device is to read them.
struct StructuralBlock {
  const std::byte* bytes;
  Index3 size;
  VoxelFormat format;
  Layout layout;

  VOX_HD int64_t subblocks() const { return size.x * size.y * size.z / 8; }
  VOX_HD Link link(int64_t subblock) const {
    if (layout == Layout::plain) return unpack_link(load_aligned_le<uint64_t>(links() + subblock * 8));
    Link link;
    for (int i = 0; i < 8; ++i) {
      const uint32_t word = load_word(bytes + (subblock * 8 + i) * word_bytes(format), format);
      link.first |= uint64_t{word & 15u} << (4 * i);
      link.mask = static_cast<uint8_t>(link.mask | (word & 16u ? 0u : 1u << i));
    }
    return link;
  }
  VOX_HD Voxel value(int64_t voxel) const {
    if (layout == Layout::thesis)
      return thesis_value(load_word(bytes + voxel * word_bytes(format), format), format);
    // Four bytes are always there, since the links follow: one load, where a copy of 1 to 4 bytes would be a
    // loop.
    const uint32_t four = load_le<uint32_t>(bytes + voxel * value_bytes(format));
    return Voxel::of(four & (~uint32_t{0} >> (32 - 8 * value_bytes(format))));
  }

 private:
  VOX_HD const std::byte* links() const { return bytes + subblocks() * subblock_bytes(format); }
};
uint64_t structural_block_bytes(uint64_t voxels, VoxelFormat f, Layout layout);

/// Blocks of a level are stored 2^n to a chunk, the last chunk holding the rest: as many as make at most 1
/// MiB.
int blocks_per_chunk_log2(uint64_t block_bytes);

/// BITMAP values above the base level are coverage: decoded to 1 from 128 on.
VOX_HD inline Voxel decoded_value(const Voxel& value, VoxelFormat f) {
  return f == VoxelFormat::bitmap ? Voxel::of<uint8_t>(value.as<uint8_t>() >= 128) : value;
}

std::vector<std::byte> pack_params(const Params& params, std::span<const Level> levels);
struct ParamsAndLevels {
  Params params;
  std::vector<Level> levels;
};
/// Checks that the levels are exactly those that plan_levels would make for `info`.
Result<ParamsAndLevels> unpack_params(std::span<const std::byte> bytes, const VolumeInfo& info,
                                      const std::string& file);

}  // namespace voxkit::svmm
