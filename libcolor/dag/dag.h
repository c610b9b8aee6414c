// The geometry of a coloured surface: a sparse voxel octree whose equal subtrees are stored once, and which
// knows for every voxel where its colour is. Source: D. Dolonius et al., "Compressing Color Data for
// Voxelized Surface Geometry", TVCG 2019, section 3. File: formats/FORMAT.md, section 4.
//
// A grid of 2^h voxels a side is a node of height h. Height 2 is a leaf: one 64 bit word, in which bit i is
// the voxel with the Morton code i. Above, a node is a run of 32 bit words:
//
//   word 0        bits 0 to 7: which octants there are, by their Morton number; bits 8 to 31: how many
//                 colours there are below, or `wide_count`
//   1 .. n        a pointer for each of the n octants: the number of a leaf, or of the first word of a node
//                 among those of its height
//   n + 1, n + 2  with `wide_count` only: the number of colours, 64 bits
//
// With Counts::pointer, which is Dado's variant, the count is zero and there is, after each pointer, how many
// colours of this node come before the octant's.
//
// Colours are in the order of a walk, depth first, along a curve. With Colors::all, each node, leaf word and
// octant of a leaf word has a colour as well, before those below it.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/hd.h"
#include "libcolor/dag/octant_order.h"

namespace voxkit::color {

inline constexpr uint32_t wide_count = 0xffffff;

/// By mask of octants: how many there are. Processors that are not asked for more than what all of them have
/// would call a function for that.
inline constexpr auto octant_counts = [] {
  std::array<uint8_t, 256> counts{};
  for (size_t mask = 0; mask < 256; ++mask) counts[mask] = static_cast<uint8_t>(std::popcount(mask));
  return counts;
}();
VOX_HD_HOT uint32_t count_octants(uint32_t mask) {
#ifdef __CUDA_ARCH__
  return static_cast<uint32_t>(__popc(mask));
#else
  return octant_counts[mask];
#endif
}

/// Octants of a leaf word that hold voxels, as a mask.
VOX_HD constexpr uint32_t leaf_octants(uint64_t leaf) {
  uint32_t mask = 0;
  for (int i = 0; i < 8; ++i) mask |= (leaf >> 8 * i & 0xff) != 0 ? 1u << i : 0;
  return mask;
}
/// How many colours a leaf word has.
VOX_HD inline uint32_t leaf_colors(uint64_t leaf, Colors colors) {
  const auto voxels = static_cast<uint32_t>(std::popcount(leaf));
  if (colors == Colors::leaf) return voxels;
  return voxels + 1 + count_octants(leaf_octants(leaf));
}
/// The number, among the colours of a leaf word that is gone through in a state, of that of voxel `bit`,
/// which is there.
inline uint32_t leaf_index(uint64_t leaf, uint32_t bit, Colors colors, OrderState state) {
  const auto before = static_cast<uint32_t>(std::popcount(leaf & octant_orders.voxels_before[state][bit]));
  if (colors == Colors::leaf) return before;
  const uint32_t octant = bit >> 3;
  const uint32_t octants = leaf_octants(leaf) & (octant_orders.before[state][octant] | 1u << octant);
  return before + 1 + count_octants(octants);
}

/// Words of a node with `octants` children.
VOX_HD constexpr uint32_t node_words(uint32_t octants, bool wide, Counts counts) {
  if (counts == Counts::pointer) return 1 + 2 * octants;
  return 1 + octants + (wide ? 2 : 0);
}

/// A DAG in memory.
struct Dag {
  int height = leaf_height;  ///< the side is 2^height voxels; of the root
  Colors colors = Colors::leaf;
  Counts counts = Counts::node;
  Curve curve = Curve::morton;
  std::vector<uint64_t> leaves;
  std::vector<std::vector<uint32_t>> nodes;  ///< by height; the first ones, below 3, have none
  uint32_t root = 0;                         ///< the number of the root among those of its height
  uint64_t voxels = 0, color_count = 0;
  uint64_t node_count = 0;  ///< nodes, leaves not counted
};

}  // namespace voxkit::color
