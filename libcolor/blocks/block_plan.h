// How a macro block is cut into blocks.
#pragma once

#include <cstdint>
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

/// The paper's way: blocks are merged greedily, first without weights, then with one more bit each time
/// (Algorithm 1), then those of the tree that cost least are taken (Algorithm 2). `least_bits` ..
/// `most_bits`: of a weight; one number for fixed weights. Every colour is in one block, and all blocks are
/// feasible.
std::vector<PlannedBlock> merge_greedily(const MacroColors& colors, const Fitter& fitter, Endpoints endpoints,
                                         int least_bits, int most_bits);

/// For weights of variable size, the cheapest blocks there are, as far as is tried: by dynamic programming
/// over the blocks without weights that greedy merging finds. `effort`, 2 to 9: how many ends of a block are
/// tried.
std::vector<PlannedBlock> parse_optimally(const MacroColors& colors, const Fitter& fitter,
                                          Endpoints endpoints, int effort);

}  // namespace voxkit::color
