// The bits of block encoded colours, and how one is found and decoded. Source: D. Dolonius et al.,
// "Compressing Color Data for Voxelized Surface Geometry", TVCG 2019, sections 4.2 and 4.3. File:
// formats/FORMAT.md, section 4.
//
// Colours come in parts, of up to 2^20, each on its own:
//
//   u32            blocks in the part
//   u32            zero
//   2 x u64        for each macro block of 16384 colours: its first block, and the first bit of its weights
//   8 or 10 bytes  for each block: its header
//   weights, from the next multiple of 8 on, and 8 bytes of zero
//
// A header: a word with the number of the block's first colour in its macro block (14 bits), the bits of a
// weight less 1 (2 bits) and the first bit of its weights, from those of the macro block (16 bits;
// `no_weights`: one colour for all); then the endpoints. With `raw_macro_block` colours lie where weights
// would, 24 bits each, without blocks. Attributes of one or two bytes are colours whose other channels are
// black, and not stored: headers have 6 or 8 bytes, and raw values one or two.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "formats/hd.h"
#include "formats/little_endian.h"
#include "libcolor/params.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

inline constexpr uint32_t macro_block_colors = 1 << 14;
inline constexpr uint32_t no_weights = 0xffff;
inline constexpr uint64_t raw_macro_block = uint64_t{1} << 63;
inline constexpr uint32_t part_head = 8, macro_head = 16, part_tail = 8;

/// Of a value that is stored as it is.
VOX_HD constexpr uint32_t value_bytes(Endpoints endpoints) {
  return endpoints == Endpoints::one ? 1 : endpoints == Endpoints::two ? 2 : 3;
}
VOX_HD constexpr uint32_t header_bytes(Endpoints endpoints) {
  return endpoints == Endpoints::rgb565 ? 8 : 4 + 2 * value_bytes(endpoints);
}

/// 5 and 6 bits to 8, the highest ones repeated.
VOX_HD constexpr uint8_t from_5_bits(uint32_t v) {
  return static_cast<uint8_t>(v << 3 | v >> 2);
}
VOX_HD constexpr uint8_t from_6_bits(uint32_t v) {
  return static_cast<uint8_t>(v << 2 | v >> 4);
}
VOX_HD constexpr Rgb from_565(uint32_t v) {
  return {from_5_bits(v & 31), from_6_bits(v >> 5 & 63), from_5_bits(v >> 11 & 31)};
}
/// One colour in 32 bits: 10, 12 and 10 of them.
VOX_HD constexpr Rgb from_single(uint32_t v) {
  return {static_cast<uint8_t>(((v & 1023) * 255 + 511) / 1023),
          static_cast<uint8_t>(((v >> 10 & 4095) * 255 + 2047) / 4095),
          static_cast<uint8_t>(((v >> 22) * 255 + 511) / 1023)};
}
VOX_HD constexpr uint32_t to_single(Rgb c) {
  return (c.r * 1023u + 127) / 255 | ((c.g * 4095u + 127) / 255) << 10 | ((c.b * 1023u + 127) / 255) << 22;
}

/// Weight w of `most`, which is 2^bits - 1, between two values, rounded (equation 1).
VOX_HD constexpr uint8_t mix(uint32_t a, uint32_t b, uint32_t w, uint32_t most) {
  return static_cast<uint8_t>((2 * (a * (most - w) + b * w) + most) / (2 * most));
}
VOX_HD constexpr Rgb mix(Rgb a, Rgb b, uint32_t w, uint32_t most) {
  return {mix(a.r, b.r, w, most), mix(a.g, b.g, w, most), mix(a.b, b.b, w, most)};
}

/// A part of the colours, to be read. Safe on any bytes: what is not there is black.
class PartView {
 public:
  PartView() = default;
  /// `colors`: those of the part, 1 to 2^20.
  VOX_HD PartView(const std::byte* bytes, uint64_t size, uint32_t colors, Endpoints endpoints)
      : endpoints_(endpoints),
        colors_(colors),
        macro_blocks_((colors + macro_block_colors - 1) / macro_block_colors) {
    const uint64_t heads = part_head + uint64_t{macro_blocks_} * macro_head;
    if (size < heads + part_tail) return;
    const uint64_t blocks = load_le<uint32_t>(bytes);
    const uint64_t weights = (heads + blocks * header_bytes(endpoints) + 7) / 8 * 8;
    if (weights + part_tail > size) return;
    bytes_ = bytes;
    blocks_ = static_cast<uint32_t>(blocks);
    headers_ = bytes + heads;
    weights_ = bytes + weights;
    weight_bits_ = (size - weights - part_tail) * 8;
  }

  /// Whether the bytes have room for what they say they hold.
  VOX_HD bool valid() const { return bytes_ != nullptr; }
  VOX_HD uint32_t blocks() const { return blocks_; }
  VOX_HD uint32_t macro_blocks() const { return macro_blocks_; }
  VOX_HD uint64_t weight_bits() const { return weight_bits_; }

  struct MacroBlock {
    uint32_t first = 0, last = 0;  ///< its blocks, half open
    uint64_t weights = 0;          ///< the first bit of its weights
    bool raw = false;
  };
  VOX_HD MacroBlock macro_block(uint32_t m) const {
    const std::byte* const head = bytes_ + part_head + m * macro_head;
    const auto first = load_le<uint64_t>(head);
    const uint64_t next =
        m + 1 < macro_blocks_ ? load_le<uint64_t>(head + macro_head) & ~raw_macro_block : blocks_;
    MacroBlock macro;
    macro.raw = (first & raw_macro_block) != 0;
    macro.weights = load_le<uint64_t>(head + 8);
    const uint64_t begin = first & ~raw_macro_block;
    if (begin > next || next > blocks_) return macro;
    macro.first = static_cast<uint32_t>(begin);
    macro.last = static_cast<uint32_t>(next);
    return macro;
  }

  struct Block {
    uint32_t first = 0;    ///< colour, in its macro block
    uint32_t bits = 0;     ///< of a weight; 0: one colour
    uint32_t weights = 0;  ///< first bit, from those of the macro block
    Rgb a, b;              ///< both ends
  };
  VOX_HD uint32_t first_color(uint32_t block) const { return load_le<uint32_t>(header(block)) & 0x3fff; }
  VOX_HD Block block(uint32_t number) const {
    const std::byte* const bytes = header(number);
    const auto word = load_le<uint32_t>(bytes);
    Block block;
    block.first = word & 0x3fff;
    block.weights = word >> 16;
    block.bits = block.weights == no_weights ? 0 : (word >> 14 & 3) + 1;
    if (endpoints_ != Endpoints::rgb565) {
      block.a = value_at(bytes + 4);
      block.b = value_at(bytes + 4 + value_bytes(endpoints_));
    } else if (block.bits == 0) {
      block.a = block.b = from_single(load_le<uint32_t>(bytes + 4));
    } else {
      block.a = from_565(load_le<uint16_t>(bytes + 4));
      block.b = from_565(load_le<uint16_t>(bytes + 6));
    }
    return block;
  }
  /// The last block of a macro block that begins at or before a colour; `last` if there is none.
  VOX_HD uint32_t find_block(const MacroBlock& macro, uint32_t color) const {
    uint32_t lo = macro.first, hi = macro.last;
    while (lo < hi) {
      const uint32_t middle = lo + (hi - lo) / 2;
      if (first_color(middle) <= color)
        lo = middle + 1;
      else
        hi = middle;
    }
    return lo > macro.first ? lo - 1 : macro.last;
  }
  /// A colour of a block that begins at or before it.
  VOX_HD Rgb color_in(const MacroBlock& macro, const Block& block, uint32_t color) const {
    if (block.bits == 0) return block.a;
    const uint32_t most = (1u << block.bits) - 1;
    const uint64_t at = macro.weights + block.weights + uint64_t{color - block.first} * block.bits;
    if (at >= weight_bits_) return {};
    return mix(block.a, block.b, load_le<uint32_t>(weights_ + (at >> 3)) >> (at & 7) & most, most);
  }
  VOX_HD Rgb raw_color(const MacroBlock& macro, uint32_t color) const {
    const uint64_t at = macro.weights / 8 + uint64_t{color} * value_bytes(endpoints_);
    if (at + value_bytes(endpoints_) > weight_bits_ / 8) return {};
    return value_at(weights_ + at);
  }
  /// Colour `index` of the part.
  VOX_HD Rgb color(uint32_t index) const {
    if (bytes_ == nullptr || index >= colors_) return {};
    const MacroBlock macro = macro_block(index / macro_block_colors);
    const uint32_t within = index % macro_block_colors;
    if (macro.raw) return raw_color(macro, within);
    const uint32_t number = find_block(macro, within);
    if (number == macro.last) return {};
    return color_in(macro, block(number), within);
  }

 private:
  VOX_HD Rgb value_at(const std::byte* p) const {
    Rgb value{static_cast<uint8_t>(p[0])};
    if (endpoints_ != Endpoints::one) value.g = static_cast<uint8_t>(p[1]);
    if (value_bytes(endpoints_) == 3) value.b = static_cast<uint8_t>(p[2]);
    return value;
  }
  VOX_HD const std::byte* header(uint32_t block) const {
    return headers_ + uint64_t{block} * header_bytes(endpoints_);
  }

  const std::byte* bytes_ = nullptr;
  const std::byte* headers_ = nullptr;
  const std::byte* weights_ = nullptr;
  uint64_t weight_bits_ = 0;
  Endpoints endpoints_ = Endpoints::rgb565;
  uint32_t colors_ = 0, macro_blocks_ = 0, blocks_ = 0;
};

}  // namespace voxkit::color
