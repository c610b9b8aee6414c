// The bits of palette encoded colours, and how one is found and decoded. Source: B. Dado, T. R. Kol,
// P. Bauszat, J.-M. Thiery, E. Eisemann, "Geometry and Attribute Compression for Voxel Scenes", CGF 2016, as
// D. Dolonius et al. describe it. File: formats/FORMAT.md, section 4.7.
//
// Colours come in parts, of up to 2^20, each on its own:
//
//   u32       blocks in the part
//   u32       entries of all block palettes
//   2 x u32   for each macro block of 16384 colours: its first block, and the first bit of its indices
//   7 bytes   for each block: its header
//   entries   numbers of colours of the global palette, each with as many bits as that needs
//   indices   from the next whole byte on, and 8 bytes of zero
//
// A header: the number of the block's first colour in its macro block (14 bits); the width of its indices (4
// bits); the first bit of these, from those of the macro block (18 bits); then 20 bits. Width 0: one colour
// for all, which these 20 bits name. Width 1 to 14: indices into the entries from that one on, which are the
// block's palette; blocks may share some or all of it. `direct_width`: indices are into the global palette.
#pragma once

#include <cstddef>
#include <cstdint>

#include "formats/hd.h"
#include "formats/little_endian.h"
#include "libcolor/blocks/block_layout.h"
#include "libcolor/palette/palette.h"

namespace voxkit::color {

inline constexpr uint32_t direct_width = 15;
inline constexpr uint32_t palette_part_head = 8, palette_macro_head = 8, palette_header = 7;

/// A global palette as it lies in a file: R, G and B of each colour, 0 to 2^16 of them.
struct PaletteBytes {
  const std::byte* bytes = nullptr;
  uint32_t colors = 0;

  VOX_HD Rgb color(uint32_t i) const {
    if (i >= colors) return {};
    const std::byte* const p = bytes + uint64_t{i} * 3;
    return {static_cast<uint8_t>(p[0]), static_cast<uint8_t>(p[1]), static_cast<uint8_t>(p[2])};
  }
};

/// A part of the colours, to be read. Safe on any bytes: what is not there is black.
class PaletteView {
 public:
  PaletteView() = default;
  /// `colors`: those of the part, 1 to 2^20. `bits`: palette_bits() of the global palette.
  VOX_HD PaletteView(const std::byte* bytes, uint64_t size, uint32_t colors, uint32_t bits)
      : bits_(bits), colors_(colors), macro_blocks_((colors + macro_block_colors - 1) / macro_block_colors) {
    const uint64_t heads = palette_part_head + uint64_t{macro_blocks_} * palette_macro_head;
    if (size < heads + part_tail) return;
    const uint64_t blocks = load_le<uint32_t>(bytes), entries = load_le<uint32_t>(bytes + 4);
    const uint64_t first_entry = heads + blocks * palette_header;
    const uint64_t indices = first_entry + (entries * bits + 7) / 8;
    if (indices + part_tail > size) return;
    bytes_ = bytes;
    blocks_ = static_cast<uint32_t>(blocks);
    entry_count_ = static_cast<uint32_t>(entries);
    headers_ = bytes + heads;
    entries_ = bytes + first_entry;
    indices_ = bytes + indices;
    index_bits_ = (size - indices - part_tail) * 8;
  }

  /// Whether the bytes have room for what they say they hold.
  VOX_HD bool valid() const { return bytes_ != nullptr; }
  VOX_HD uint32_t blocks() const { return blocks_; }
  VOX_HD uint32_t entries() const { return entry_count_; }
  VOX_HD uint32_t colors() const { return colors_; }
  VOX_HD uint32_t macro_blocks() const { return macro_blocks_; }
  VOX_HD uint64_t index_bits() const { return index_bits_; }

  struct MacroBlock {
    uint32_t first = 0, last = 0;  ///< its blocks, half open
    uint32_t indices = 0;          ///< the first bit of its indices
  };
  VOX_HD MacroBlock macro_block(uint32_t m) const {
    const std::byte* const head = bytes_ + palette_part_head + m * palette_macro_head;
    const auto first = load_le<uint32_t>(head);
    const uint32_t next = m + 1 < macro_blocks_ ? load_le<uint32_t>(head + palette_macro_head) : blocks_;
    if (first > next || next > blocks_) return {0, 0, load_le<uint32_t>(head + 4)};
    return {first, next, load_le<uint32_t>(head + 4)};
  }

  struct Block {
    uint32_t first = 0;    ///< colour, in its macro block
    uint32_t width = 0;    ///< of an index; 0: one colour
    bool direct = false;   ///< indices are into the global palette
    uint32_t indices = 0;  ///< first bit, from those of the macro block
    uint32_t palette = 0;  ///< its first entry; of one colour: that
  };
  VOX_HD uint32_t first_color(uint32_t block) const { return load_le<uint32_t>(header(block)) & 0x3fff; }
  VOX_HD Block block(uint32_t number) const {
    const auto word = load_le<uint64_t>(header(number));
    const auto width = static_cast<uint32_t>(word >> 14 & 15);
    Block block;
    block.first = static_cast<uint32_t>(word & 0x3fff);
    block.direct = width == direct_width;
    block.width = block.direct ? bits_ : width;
    block.indices = static_cast<uint32_t>(word >> 18 & 0x3ffff);
    block.palette = static_cast<uint32_t>(word >> 36 & 0xfffff);
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
  /// The number, in the global palette, of a colour of a block that begins at or before it; `no_color` where
  /// that does not lie in the part.
  static constexpr uint32_t no_color = ~uint32_t{0};
  VOX_HD uint32_t color_in(const MacroBlock& macro, const Block& block, uint32_t color) const {
    if (block.width == 0 && !block.direct) return block.palette;
    const uint64_t at = uint64_t{macro.indices} + block.indices + uint64_t{color - block.first} * block.width;
    if (at + block.width > index_bits_) return no_color;
    const uint32_t index = bits_at(indices_, at, block.width);
    if (block.direct) return index;
    const uint64_t entry = uint64_t{block.palette} + index;
    return entry < entry_count_ ? bits_at(entries_, entry * bits_, bits_) : no_color;
  }
  /// The same of color `index` of the part.
  VOX_HD uint32_t number(uint32_t index) const {
    if (bytes_ == nullptr || index >= colors_) return no_color;
    const MacroBlock macro = macro_block(index / macro_block_colors);
    const uint32_t within = index % macro_block_colors, at = find_block(macro, within);
    return at == macro.last ? no_color : color_in(macro, block(at), within);
  }

 private:
  /// Up to 16 bits.
  VOX_HD static uint32_t bits_at(const std::byte* from, uint64_t at, uint32_t bits) {
    return load_le<uint32_t>(from + (at >> 3)) >> (at & 7) & ((1u << bits) - 1);
  }
  VOX_HD const std::byte* header(uint32_t block) const { return headers_ + uint64_t{block} * palette_header; }

  const std::byte* bytes_ = nullptr;
  const std::byte* headers_ = nullptr;
  const std::byte* entries_ = nullptr;
  const std::byte* indices_ = nullptr;
  uint64_t index_bits_ = 0;
  uint32_t bits_ = 0, colors_ = 0, macro_blocks_ = 0, blocks_ = 0, entry_count_ = 0;
};

/// Colours of a part one after the other, or in any order.
class PaletteReader {
 public:
  void open(const PaletteView& view, const PaletteBytes& palette) {
    view_ = view;
    palette_ = palette;
    first_ = last_ = 0;
  }
  /// Colour `index` of the part, which has it.
  Rgb color(uint32_t index) { return palette_.color(number(index)); }
  /// Its number in the palette; none of its colours where it is not there.
  uint32_t number(uint32_t index) {
    if ((index < first_ || index >= last_) && !find(index)) return PaletteView::no_color;
    return view_.color_in(macro_, block_, index % macro_block_colors);
  }

 private:
  bool find(uint32_t index) {
    first_ = last_ = 0;
    if (!view_.valid()) return false;
    const uint32_t number = index / macro_block_colors, base = number * macro_block_colors;
    macro_ = view_.macro_block(number);
    const uint32_t block = view_.find_block(macro_, index - base);
    if (block == macro_.last) return false;
    block_ = view_.block(block);
    const uint32_t end =
        block + 1 < macro_.last ? base + view_.first_color(block + 1) : base + macro_block_colors;
    first_ = base + block_.first;
    last_ = end;
    return true;
  }

  PaletteView view_;
  PaletteBytes palette_;
  PaletteView::MacroBlock macro_;
  PaletteView::Block block_;
  uint32_t first_ = 0, last_ = 0;  ///< colours of the part that the block has
};

}  // namespace voxkit::color
