// How a macro block of palette encoded colours is cut into blocks, and where the palettes of these lie.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace voxkit::color {

/// A block: colours first .. last of its macro block, half open, with indices of `width` bits, or
/// direct_width.
struct PaletteBlock {
  uint32_t first, last;
  uint32_t width;
};

/// The cheapest cut of 1 to 16384 colours, numbers of the global palette, by dynamic programming over runs of
/// one colour. `bits`: of such a
/// number. Blocks other than direct ones have no more than `reach` runs.
std::vector<PaletteBlock> cut_palette_blocks(std::span<const uint16_t> colors, uint32_t bits, uint32_t reach);

/// The list of entries of a part. A block's palette is 2^width of them that follow each other and have all
/// its colours among them, wherever they are: blocks share them as a whole or overlap.
class PaletteEntries {
 public:
  /// `colors`: of the global palette.
  explicit PaletteEntries(uint32_t colors) : places_(colors), wanted_(colors), seen_(colors) {}
  /// Finds, or makes, room for different colours, 2 to 2^width of them; says where it begins.
  uint32_t add(std::span<const uint16_t> colors, uint32_t width);
  /// Final when nothing more is added.
  const std::vector<uint16_t>& entries() const { return entries_; }

 private:
  std::optional<uint32_t> find_settled(std::span<const uint16_t> colors, uint32_t size);
  uint32_t append(std::span<const uint16_t> colors, uint32_t size);

  std::vector<uint16_t> entries_;
  uint32_t settled_ = 0;                       ///< entries whose order is final
  std::vector<std::vector<uint32_t>> places_;  ///< by colour: of settled entries
  std::vector<uint8_t> wanted_;                ///< by colour: whether it is looked for
  std::vector<uint32_t> seen_;                 ///< by colour: how often, where that is looked for
};

}  // namespace voxkit::color
