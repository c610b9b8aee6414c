// Finds what lies near, by going down a tree with all queries at once: a node sees those that reach its box,
// a leaf compares 32 bricks at a time with each of them, and what is left is measured exactly.
#pragma once

#include <bit>
#include <deque>

#include "libvq/nearest_kernel.h"
#include "libvq/nearest_tree.h"

namespace voxkit::vq {

/// Queries that go down together.
class QueryBlock {
 public:
  /// As many as fit the caches, with what is made of them on the way down.
  static constexpr size_t most = 4096;

  void clear() {
    keys_.clear();
    rows_.size = 0;
  }
  size_t size() const { return keys_.size(); }
  /// `brick` must stay where it is. `reach`: as KeySpace::reach of what is still of interest, or 0 where the
  /// bricks of the tree have reaches.
  void add(const Key& key, const Brick& brick, int32_t reach) {
    const size_t n = rows_.size++;
    rows_.make_room(n + 1);
    for (int j = 0; j < coarse_pairs; ++j) rows_.pairs[static_cast<size_t>(j)][n] = key_pair(key.coarse, j);
    rows_.reach[n] = reach;
    rows_.number[n] = static_cast<uint32_t>(n);
    keys_.push_back(query_key(key, brick, reach));
  }
  const QueryRows& rows() const { return rows_; }
  const std::vector<QueryKey>& keys() const { return keys_; }

 private:
  QueryRows rows_;
  std::vector<QueryKey> keys_;
};

/// Space for one search at a time.
class SearchSpace {
 public:
  QueryRows& rows(size_t depth) {
    while (rows_.size() <= depth) rows_.emplace_back();
    return rows_[depth];
  }
  std::vector<uint32_t>& masks() { return masks_; }

 private:
  std::deque<QueryRows> rows_;
  std::vector<uint32_t> masks_;
};

/// Searches a branch of `tree` for what `queries` may find. `finder` has
///
///   int32_t reach(size_t node)             the greatest reach of the bricks below it, now; -1: go no further
///   const uint32_t* edges(size_t leaf)     of each, norm of its key less reach, now; 0 reach finds nothing
///   void found(size_t position, uint32_t query, uint64_t squared_distance)
///   void leave(const Branch&)              all that is below has been searched
///
/// It is told at least of all bricks where the distance is no more than the root of both reaches together,
/// those of a leaf in the order of the queries.
template <class Finder>
void search(const BrickTree& tree, const Kernels& kernels, const Branch& branch, const QueryBlock& queries,
            const QueryRows& arriving, SearchSpace& space, size_t depth, Finder& finder) {
  const int32_t reach = finder.reach(branch.node);
  if (reach < 0) return;
  QueryRows& near = space.rows(depth);
  kernels.near_box(tree.box(branch.node), reach, arriving, near);
  if (near.size == 0) return;
  if (!branch.is_leaf()) {
    search(tree, kernels, branch.left(), queries, near, space, depth + 1, finder);
    search(tree, kernels, branch.right(), queries, near, space, depth + 1, finder);
    return finder.leave(branch);
  }
  const Brick* bricks = tree.leaf_bricks_of(branch.first);
  const uint32_t present = tree.present(branch.first);
  // What will be measured is on its way while keys are compared.
  if (near.size > 16)
    for (size_t i = 0; i < static_cast<size_t>(std::popcount(present)); ++i) {
      __builtin_prefetch(&bricks[i]);
      __builtin_prefetch(&bricks[i][brick_voxels / 2]);
    }
  std::vector<uint32_t>& masks = space.masks();
  constexpr size_t at_once = 256;  // then reaches are looked at again
  masks.resize(at_once + 1);
  std::array<uint64_t, leaf_bricks> distances;
  for (size_t begin = 0; begin < near.size; begin += at_once) {
    const size_t count = std::min(at_once, near.size - begin);
    const uint32_t* numbers = near.number.data() + begin;
    kernels.near_bricks(tree.leaf(branch.first), finder.edges(branch.first), queries.keys().data(), numbers,
                        count, masks.data());
    for (size_t k = 0; k < count; ++k) {
      uint32_t mask = masks[k] & present;
      if (mask == 0) continue;
      kernels.distances(bricks, mask, *queries.keys()[numbers[k]].brick, distances.data());
      for (; mask != 0; mask &= mask - 1) {
        const auto bit = static_cast<size_t>(std::countr_zero(mask));
        finder.found(branch.first * leaf_bricks + bit, numbers[k], distances[bit]);
      }
    }
  }
  finder.leave(branch);
}

}  // namespace voxkit::vq
