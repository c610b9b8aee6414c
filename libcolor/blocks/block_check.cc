#include "libcolor/blocks/block_check.h"

#include <fmt/format.h>

#include <algorithm>

#include "libcolor/blocks/block_layout.h"

namespace voxkit::color {

std::string check_block_part(std::span<const std::byte> part, const Params& params, uint32_t colors) {
  const PartView view(part.data(), part.size(), colors, params.endpoints);
  if (!view.valid()) return "fewer bytes than its blocks take";
  uint32_t next = 0;
  for (uint32_t m = 0; m < view.macro_blocks(); ++m) {
    const PartView::MacroBlock macro = view.macro_block(m);
    const uint32_t size = std::min(macro_block_colors, colors - m * macro_block_colors);
    const auto wrong = [&](const char* what) { return fmt::format("macro block {}: {}", m, what); };
    if (macro.first != next || (macro.raw ? macro.last != next : macro.last <= next))
      return wrong("not its blocks");
    next = macro.last;
    if (macro.raw) {
      if (macro.weights % 8 != 0 ||
          macro.weights + uint64_t{size} * 8 * value_bytes(params.endpoints) > view.weight_bits())
        return wrong("colors behind the end");
      continue;
    }
    for (uint32_t b = macro.first; b < macro.last; ++b) {
      const PartView::Block block = view.block(b);
      const uint32_t end = b + 1 < macro.last ? view.first_color(b + 1) : size;
      if (b == macro.first && block.first != 0) return wrong("no block for its first color");
      if (end <= block.first) return wrong("blocks out of order");
      if (macro.weights + (block.bits == 0 ? 0 : block.weights) + uint64_t{end - block.first} * block.bits >
          view.weight_bits())
        return wrong("weights behind the end");
    }
  }
  return next == view.blocks() ? "" : "blocks of no macro block";
}

}  // namespace voxkit::color
