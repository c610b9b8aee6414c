// Reading bricks from a compressed volume, on the host or a device: where a brick is, its range, its codes.
#pragma once

#include "libvq/rbuc.h"
#include "libvq/vq.h"

namespace voxkit::vq {

/// The offset volume is cut into blocks of 4^3 bricks, whose entries are relative to a base of their own.
inline constexpr int block_edge = 4;
inline constexpr int block_bricks = block_edge * block_edge * block_edge;
inline constexpr int block_chunk_log2 = 12;  ///< blocks to a chunk of the offset volume
inline constexpr int block_header = 8;   ///< bytes: u32 base, u32 start of the entries in units of 8 bytes
inline constexpr int widest_entry = 32;  ///< bits
/// Tables of addresses: for each group of bricks the first one's address, and the length of each.
inline constexpr int group_log2 = 5, group_bricks = 1 << group_log2;
inline constexpr int group_bytes = 8 + group_bricks;
inline constexpr int group_chunk_log2 = 14;  ///< groups to a chunk
/// An address is the chunk of the codebook and the byte in it; no brick lies in two chunks.
inline constexpr int address_chunk_log2 = 20;

/// Bytes of the least and greatest code of a brick, in front of its codeword.
constexpr int range_bytes(int bits) {
  return (2 * bits + 7) / 8;
}
/// Bytes of a brick of a packed codebook.
constexpr int packed_bytes(int bits) {
  return range_bytes(bits) + plain_bytes(bits);
}
/// Packed bricks to a chunk: the greatest power of two of them that fits into 2^20 bytes.
constexpr int packed_chunk_log2(int bits) {
  int log2 = 0;
  while (packed_bytes(bits) << (log2 + 1) <= 1 << 20) ++log2;
  return log2;
}

/// What a reader needs to know of a volume, without pointers.
struct View {
  uint32_t bricks[3] = {}, blocks[3] = {};  ///< along x, y, z
  Codebook codebook = Codebook::rbuc;
  Mapping mapping = Mapping::indirect;
  int bits = 1;
  int range_bytes = 1;        ///< in front of a codeword
  int packed_bytes = 0;       ///< of a packed brick
  int packed_chunk_log2 = 0;  ///< packed bricks to a chunk
  uint64_t codewords = 0;
  uint64_t common = 0;        ///< the id that entries of 0 stand for
  double base = 0, step = 1;  ///< a code stands for base + step * code
};

/// Bytes of a chunk; null where it is missing or damaged.
struct Bytes {
  const std::byte* data = nullptr;
  uint64_t size = 0;
};

/// A brick that has been found.
struct Record {
  BrickRange range;
  const std::byte* code = nullptr;  ///< its codeword, or packed codes; means nothing where min = max
  uint32_t available = 0;           ///< bytes from there on that may belong to it
};

/// Finds and decodes bricks. `Pools` has the chunks: `Bytes offsets(uint64_t part)`, `addresses` and
/// `codebook`, with read_slack bytes behind each. No function reads outside the chunks, whatever they hold;
/// where they are not valid, or null, the answer is `no_brick` or false.
template <class Pools>
class Reader {
 public:
  static constexpr uint64_t no_brick = ~uint64_t{0};

  VOX_HD_HOT Reader(const View& view, const Pools& pools) : view_(&view), pools_(&pools) {}

  /// The id of the brick at a place of the offset volume, which must be inside.
  VOX_HD_HOT uint64_t brick_id(uint32_t x, uint32_t y, uint32_t z) const {
    const uint64_t block = (uint64_t{z >> 2} * view_->blocks[1] + (y >> 2)) * view_->blocks[0] + (x >> 2);
    const Bytes chunk = pools_->offsets(block >> block_chunk_log2);
    const uint64_t at = (block & ((1u << block_chunk_log2) - 1)) * block_header;
    if (chunk.data == nullptr || at + 2 * block_header > chunk.size) return no_brick;
    const auto base = load_le<uint32_t>(chunk.data + at), start = load_le<uint32_t>(chunk.data + at + 4),
               end = load_le<uint32_t>(chunk.data + at + 12);
    const uint32_t width = end - start;
    if (end < start || width > widest_entry || uint64_t{end} * 8 > chunk.size) return no_brick;
    const uint32_t entry = load_bits(chunk.data + uint64_t{start} * 8,
                                     ((x & 3) + 4 * (y & 3) + 16 * (z & 3)) * width, static_cast<int>(width));
    return entry == 0 ? view_->common : uint64_t{base} + entry - 1;
  }

  /// Finds a brick and its range; false if there is none with this id.
  VOX_HD_HOT bool find(uint64_t id, Record& record) const {
    Bytes chunk;
    uint64_t at, available;
    if (view_->codebook == Codebook::packed) {
      if (id >= view_->codewords) return false;
      chunk = pools_->codebook(id >> view_->packed_chunk_log2);
      at =
          (id & ((uint64_t{1} << view_->packed_chunk_log2) - 1)) * static_cast<uint64_t>(view_->packed_bytes);
      available = static_cast<uint64_t>(view_->packed_bytes);
    } else {
      uint64_t address = id;
      available = static_cast<uint64_t>(view_->range_bytes + longest_codeword);
      if (view_->mapping == Mapping::indirect && !address_of(id, address, available)) return false;
      chunk = pools_->codebook(address >> address_chunk_log2);
      at = address & ((uint64_t{1} << address_chunk_log2) - 1);
      // Of a direct address, all that is left of the chunk might belong to the brick.
      if (view_->mapping == Mapping::direct && at + available > chunk.size)
        available = at < chunk.size ? chunk.size - at : 0;
    }
    if (chunk.data == nullptr || available < static_cast<uint64_t>(view_->range_bytes) ||
        at + available > chunk.size)
      return false;
    const std::byte* const bytes = chunk.data + at;
    record.range.min = static_cast<uint16_t>(load_bits(bytes, 0, view_->bits));
    record.range.max =
        static_cast<uint16_t>(load_bits(bytes, static_cast<uint64_t>(view_->bits), view_->bits));
    record.code = bytes + view_->range_bytes;
    record.available = static_cast<uint32_t>(available) - static_cast<uint32_t>(view_->range_bytes);
    return record.range.min <= record.range.max;
  }

  /// The 64 codes of a brick that was found, in raster order; false if its codeword is not valid.
  VOX_HD_HOT bool decode(const Record& record, uint16_t* codes) const {
    if (record.range.min == record.range.max) {
      for (int i = 0; i < brick_voxels; ++i) codes[i] = record.range.min;
      return true;
    }
    if (view_->codebook == Codebook::rbuc && record.available == 0) return false;
#ifdef __CUDA_ARCH__
    return view_->codebook == Codebook::packed
               ? decode_plain_portable(record.code, view_->bits, record.range, codes)
               : decode_codeword_portable(record.code, record.available, view_->bits, record.range, codes);
#else
    return view_->codebook == Codebook::packed
               ? decode_plain(record.code, view_->bits, record.range, codes)
               : decode_codeword(record.code, record.available, view_->bits, record.range, codes);
#endif
  }

  /// One code of a brick that was found, by its number in raster order; false if it cannot be decoded. Of
  /// packed bricks only that code is read.
  VOX_HD_HOT bool decode_one(const Record& record, uint32_t number, uint16_t& code) const {
    if (record.range.min == record.range.max) {
      code = record.range.min;
      return true;
    }
    if (view_->codebook == Codebook::packed) {
      code = static_cast<uint16_t>(
          load_bits(record.code, uint64_t{number} * static_cast<uint64_t>(view_->bits), view_->bits));
      return code >= record.range.min && code <= record.range.max;
    }
    uint16_t codes[brick_voxels];
    if (!decode(record, codes)) return false;
    code = codes[number];
    return true;
  }

 private:
  /// Of an indirect mapping: where a brick begins and how long it is.
  VOX_HD_HOT bool address_of(uint64_t id, uint64_t& address, uint64_t& length) const {
    if (id >= view_->codewords) return false;
    const uint64_t group = id >> group_log2;
    const Bytes chunk = pools_->addresses(group >> group_chunk_log2);
    const uint64_t at = (group & ((1u << group_chunk_log2) - 1)) * group_bytes;
    if (chunk.data == nullptr || at + group_bytes > chunk.size) return false;
    const std::byte* const bytes = chunk.data + at;
    const auto within = static_cast<uint32_t>(id) & (group_bricks - 1);
    // The lengths before, eight at a time in four sums of 16 bits.
    constexpr uint64_t even = 0x00ff00ff00ff00ff;
    uint64_t sums = 0;
    for (uint32_t i = 0; i < group_bricks / 8; ++i) {
      const uint32_t before = within > 8 * i ? within - 8 * i : 0;
      const uint64_t lengths = load_le<uint64_t>(bytes + 8 + 8 * i) &
                               (before >= 8 ? ~uint64_t{0} : (uint64_t{1} << (8 * before)) - 1);
      sums += (lengths & even) + (lengths >> 8 & even);
    }
    address = load_le<uint64_t>(bytes) + (sums * 0x0001000100010001 >> 48);
    length = static_cast<uint64_t>(bytes[8 + within]);
    return true;
  }

  const View* view_;
  const Pools* pools_;
};

}  // namespace voxkit::vq
