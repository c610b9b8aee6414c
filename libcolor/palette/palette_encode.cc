#include "libcolor/palette/palette_encode.h"

#include <algorithm>

#include "libcolor/blocks/bit_writer.h"
#include "libcolor/palette/palette_layout.h"
#include "libcolor/palette/palette_plan.h"

namespace voxkit::color {
namespace {

/// A block, and where its palette is.
struct PlacedBlock {
  PaletteBlock block;  ///< colours of the part
  uint32_t palette;    ///< first entry; of one colour: that
};

/// A part cut into blocks.
struct Plan {
  std::vector<PlacedBlock> blocks;
  std::vector<uint16_t> entries;
};

Plan plan_of(std::span<const uint16_t> colors, uint32_t palette_colors, uint32_t reach) {
  Plan plan;
  PaletteEntries entries(palette_colors);
  std::vector<uint16_t> own;
  for (size_t base = 0; base < colors.size(); base += macro_block_colors) {
    const auto macro = colors.subspan(base, std::min<size_t>(macro_block_colors, colors.size() - base));
    for (const PaletteBlock& block : cut_palette_blocks(macro, palette_bits(palette_colors), reach)) {
      uint32_t palette = 0;
      if (block.width == 0) {
        palette = macro[block.first];
      } else if (block.width != direct_width) {
        own.assign(macro.begin() + block.first, macro.begin() + block.last);
        std::sort(own.begin(), own.end());
        own.erase(std::unique(own.begin(), own.end()), own.end());
        palette = entries.add(own, block.width);
      }
      const auto shift = static_cast<uint32_t>(base);
      plan.blocks.push_back({{block.first + shift, block.last + shift, block.width}, palette});
    }
  }
  plan.entries = entries.entries();
  return plan;
}

/// One block a macro block, without palettes of their own.
Plan direct_plan(uint32_t colors) {
  Plan plan;
  for (uint32_t first = 0; first < colors; first += macro_block_colors)
    plan.blocks.push_back({{first, std::min(colors, first + macro_block_colors), direct_width}, 0});
  return plan;
}

std::vector<std::byte> bytes_of(std::span<const uint16_t> colors, const Plan& plan, uint32_t palette_colors) {
  const uint32_t bits = palette_bits(palette_colors);
  const size_t macro_blocks = (colors.size() + macro_block_colors - 1) / macro_block_colors;
  const size_t heads = palette_part_head + macro_blocks * palette_macro_head;
  std::vector<std::byte> bytes(heads + plan.blocks.size() * palette_header);
  store_le(bytes.data(), static_cast<uint32_t>(plan.blocks.size()));
  store_le(bytes.data() + 4, static_cast<uint32_t>(plan.entries.size()));

  BitWriter indices;
  uint64_t macro_bits = 0;                      // where the indices of the macro block begin
  std::vector<uint32_t> place(palette_colors);  // of a colour in the palette of the block
  for (size_t b = 0; b < plan.blocks.size(); ++b) {
    const auto& [block, palette] = plan.blocks[b];
    if (block.first % macro_block_colors == 0) {
      macro_bits = indices.size();
      std::byte* const head =
          &bytes[palette_part_head + block.first / macro_block_colors * palette_macro_head];
      store_le(head, static_cast<uint32_t>(b));
      store_le(head + 4, static_cast<uint32_t>(macro_bits));
    }
    const uint64_t word = block.first % macro_block_colors | uint64_t{block.width} << 14 |
                          (block.width == 0 ? 0 : indices.size() - macro_bits) << 18 |
                          uint64_t{palette} << 36;
    for (size_t i = 0; i < palette_header; ++i)
      bytes[heads + b * palette_header + i] = static_cast<std::byte>(word >> 8 * i & 0xff);
    if (block.width == 0) continue;
    const auto own = colors.subspan(block.first, block.last - block.first);
    if (block.width == direct_width) {
      for (const uint16_t color : own) indices.add(color, static_cast<int>(bits));
      continue;
    }
    const size_t end = std::min<size_t>(plan.entries.size(), palette + (size_t{1} << block.width));
    for (size_t i = palette; i < end; ++i) place[plan.entries[i]] = static_cast<uint32_t>(i - palette);
    for (const uint16_t color : own) indices.add(place[color], static_cast<int>(block.width));
  }
  indices.align();
  BitWriter entries;
  for (const uint16_t entry : plan.entries) entries.add(entry, static_cast<int>(bits));
  entries.align();
  bytes.insert(bytes.end(), entries.bytes().begin(), entries.bytes().end());
  bytes.insert(bytes.end(), indices.bytes().begin(), indices.bytes().end());
  bytes.resize(bytes.size() + part_tail);
  return bytes;
}

}  // namespace

EncodedPart encode_palette_part(std::span<const Rgb> colors, const Palette& palette, int effort) {
  EncodedPart part;
  std::vector<uint16_t> numbers(colors.size());
  for (size_t i = 0; i < colors.size(); ++i) {
    numbers[i] = palette.index_of(colors[i]);
    part.add_error(colors[i], palette.colors()[numbers[i]]);
  }
  encode_palette_numbers(numbers, static_cast<uint32_t>(palette.colors().size()), effort, part);
  return part;
}

void encode_palette_numbers(std::span<const uint16_t> numbers, uint32_t palette_colors, int effort,
                            EncodedPart& part) {
  const Plan plan = plan_of(numbers, palette_colors, uint32_t{32} << effort);
  part.blocks = plan.blocks.size();
  part.bytes = bytes_of(numbers, plan, palette_colors);
  // Where fewer entries were shared than was thought.
  const Plan direct = direct_plan(static_cast<uint32_t>(numbers.size()));
  if (std::vector<std::byte> bytes = bytes_of(numbers, direct, palette_colors);
      bytes.size() < part.bytes.size()) {
    part.blocks = direct.blocks.size();
    part.bytes = std::move(bytes);
  }
}

}  // namespace voxkit::color
