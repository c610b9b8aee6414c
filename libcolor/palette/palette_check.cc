#include "libcolor/palette/palette_check.h"

#include <fmt/format.h>

#include <algorithm>

namespace voxkit::color {

std::string check_palette_part(const PaletteView& view, uint32_t palette_colors) {
  if (!view.valid()) return "fewer bytes than its blocks take";
  uint32_t next = 0;
  for (uint32_t m = 0; m < view.macro_blocks(); ++m) {
    const auto wrong = [&](const char* what) { return fmt::format("macro block {}: {}", m, what); };
    const PaletteView::MacroBlock macro = view.macro_block(m);
    const uint32_t size = std::min(macro_block_colors, view.colors() - m * macro_block_colors);
    if (macro.first != next || macro.last <= next) return wrong("not its blocks");
    next = macro.last;
    for (uint32_t b = macro.first; b < macro.last; ++b) {
      const PaletteView::Block block = view.block(b);
      const uint32_t end = b + 1 < macro.last ? view.first_color(b + 1) : size;
      if (b == macro.first && block.first != 0) return wrong("no block for its first color");
      if (end <= block.first || end > size) return wrong("blocks out of order");
      for (uint32_t i = block.first; i < end; ++i)
        if (view.color_in(macro, block, i) >= palette_colors) return wrong("an index behind the end");
    }
  }
  return next == view.blocks() ? std::string() : "blocks of no macro block";
}

}  // namespace voxkit::color
