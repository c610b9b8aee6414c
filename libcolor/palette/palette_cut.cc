#include <algorithm>

#include "libcolor/palette/palette_layout.h"
#include "libcolor/palette/palette_plan.h"

namespace voxkit::color {

std::vector<PaletteBlock> cut_palette_blocks(std::span<const uint16_t> colors, uint32_t bits,
                                             uint32_t reach) {
  // Runs of one colour: where they begin, and 1 more than the run before that has the same, or 0.
  std::vector<uint32_t> begins, before;
  std::vector<uint32_t> latest(size_t{1} << bits);
  const auto size = static_cast<uint32_t>(colors.size());
  for (uint32_t i = 0; i < size; ++i) {
    if (i > 0 && colors[i] == colors[i - 1]) continue;
    before.push_back(latest[colors[i]]);
    begins.push_back(i);
    latest[colors[i]] = static_cast<uint32_t>(begins.size());
  }
  const auto runs = static_cast<uint32_t>(begins.size());
  begins.push_back(size);

  // The cheapest way to code all from a run on, in 1/16 bit.
  struct Tail {
    uint32_t cost = 0, next = 0, width = 0;
  };
  constexpr uint32_t header = 16 * 8 * palette_header;
  // Entries are shared: a part has about three for every four that its blocks use.
  const uint32_t entry = 12 * bits;
  std::vector<Tail> tails(runs + 1);
  const uint32_t direct = 16 * bits;
  uint32_t best_end = runs;  // of a direct block
  for (uint32_t i = runs; i-- > 0;) {
    const auto direct_cost = [&](uint32_t end) {
      return direct * (begins[end] - begins[i]) + tails[end].cost;
    };
    if (direct_cost(i + 1) < direct_cost(best_end)) best_end = i + 1;
    Tail best{header + direct_cost(best_end), best_end, direct_width};
    uint32_t different = 0, width = 0, entries = 0;
    const uint32_t end = std::min(runs - i, reach) + i;
    for (uint32_t j = i; j < end; ++j) {
      if (before[j] <= i) {
        ++different;
        entries += entry;
        if (different > 1u << width) ++width;
      }
      const uint32_t own = header + (different > 1 ? entries : 0) + 16 * width * (begins[j + 1] - begins[i]) +
                           tails[j + 1].cost;
      if (own <= best.cost) best = {own, j + 1, width};
    }
    tails[i] = best;
  }
  std::vector<PaletteBlock> blocks;
  for (uint32_t i = 0; i < runs; i = tails[i].next)
    blocks.push_back({begins[i], begins[tails[i].next], tails[i].width});
  return blocks;
}

}  // namespace voxkit::color
