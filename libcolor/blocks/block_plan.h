// How a macro block is cut into blocks.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "libcolor/blocks/block_fit.h"

namespace voxkit::color {

/// A block as it will be written.
struct PlannedBlock {
  uint32_t first, last;  ///< colours of the macro block, half open
  int bits;              ///< of a weight
  Fit fit;
};

/// Bits of a block in the file.
inline uint64_t block_cost(uint32_t colors, int bits, Endpoints endpoints) {
  return 8 * header_bytes(endpoints) + uint64_t{colors} * static_cast<uint64_t>(bits);
}

/// A block of the list that is merged.
struct MergeItem {
  uint32_t first, last;
  uint32_t left, right;  ///< neighbours in the list
  bool merged = false;   ///< in this round of bits
  bool tried = false;    ///< whether `joined` is known
  Fit fit = {};          ///< of a merged block
  Fit joined = {};       ///< with the right neighbour
};
/// A run of colours, and the cheapest blocks known for it, which lie one after the other in a plan.
struct MergeUnit {
  uint32_t first, last;
  uint32_t blocks;
  uint64_t cost;
};
/// The cheapest way found to code all colours from some place on.
struct ParseTail {
  uint64_t cost = 0;
  uint32_t next = 0;  ///< atom behind the block that begins here
  int bits = 0;
  Fit fit;
};

/// Memory that planning works with, kept from macro block to macro block: asking for it takes longer than
/// many a plan.
struct PlanMemory {
  std::vector<MergeItem> items;
  std::vector<MergeUnit> units, merged_units;
  std::vector<PlannedBlock> merged, cheaper, parsed;
  std::vector<uint32_t> starts;
  std::vector<ParseTail> tails;
  std::vector<std::pair<uint32_t, Fit>> feasible;
};

/// The paper's way: blocks are merged greedily, first without weights, then with one more bit each time
/// (Algorithm 1), then those of the tree that cost least are taken (Algorithm 2). `least_bits` ..
/// `most_bits`: of a weight; one number for fixed weights. Every colour is in one block, and all blocks are
/// feasible.
/// The plan is in the memory until the next one like it.
const std::vector<PlannedBlock>& merge_greedily(const MacroColors& colors, const Fitter& fitter,
                                                Endpoints endpoints, int least_bits, int most_bits,
                                                PlanMemory& memory);

/// For weights of variable size, the cheapest blocks there are, as far as is tried: by dynamic programming
/// over the blocks without weights that greedy merging finds. `effort`, 2 to 9: how many ends of a block are
/// tried.
const std::vector<PlannedBlock>& parse_optimally(const MacroColors& colors, const Fitter& fitter,
                                                 Endpoints endpoints, int effort, PlanMemory& memory);

}  // namespace voxkit::color
