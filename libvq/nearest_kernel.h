// The inner loops of the search, for each kind of machine. All give the same results.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "libvq/brick.h"
#include "libvq/nearest_key.h"

namespace voxkit::vq {

/// Keys are compared with this many bricks at a time.
inline constexpr int leaf_bricks = 32;
/// Rows of `leaf_bricks` pairs of fine coordinates.
using Leaf = std::array<std::array<int32_t, leaf_bricks>, fine_pairs>;

/// Bounds of coarse keys.
struct KeyBox {
  std::array<int16_t, coarse_axes> least, most;
};

/// Bricks that look for others, as rows to go through side by side.
struct QueryRows {
  std::array<std::vector<int32_t>, coarse_pairs> pairs;  ///< coarse keys
  std::vector<int32_t> reach;                            ///< how far this one looks, as KeySpace::reach
  std::vector<uint32_t> number;                          ///< which query of the block it is
  size_t size = 0;

  /// Makes room for `count` queries and for whole vectors beyond them; keeps what is there.
  void make_room(size_t count);
};

/// A query as it is multiplied: -2 times its fine key, and the key's norm less its reach.
struct alignas(64) QueryKey {
  std::array<int32_t, fine_pairs> doubled;
  uint32_t edge;
  const Brick* brick;
};
QueryKey query_key(const Key& key, const Brick& brick, int32_t reach);

struct Kernels {
  /// Copies to `out` the queries of `in` that may find something in a box, in their order: those whose
  /// distance from it is less than `reach` of what is inside plus their own.
  void (*near_box)(const KeyBox& box, int32_t reach, const QueryRows& in, QueryRows& out);
  /// For each of the numbered queries, the bricks of a leaf that it may be near to, one bit each: those where
  /// the squared distance of their keys is less than the two reaches together. `edges`: norms of keys less
  /// reaches. `masks` has room for one more.
  void (*near_bricks)(const Leaf& leaf, const uint32_t* edges, const QueryKey* queries,
                      const uint32_t* numbers, size_t count, uint32_t* masks);
  /// Squared distances of `brick` from the bricks whose bits are set: out[i] for bit i.
  void (*distances)(const Brick* bricks, uint32_t mask, const Brick& brick, uint64_t* out);
};

/// native: those for this machine, else the portable ones. narrow: bricks have at most 12 bits.
const Kernels& search_kernels(bool native, bool narrow);

}  // namespace voxkit::vq
