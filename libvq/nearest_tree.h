// Bricks in leaves of 32 that lie near each other, under a tree of boxes around their keys.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "formats/context.h"
#include "libvq/brick.h"
#include "libvq/nearest_kernel.h"
#include "libvq/nearest_key.h"

namespace voxkit::vq {

/// A node of the tree, and the leaves below it. The root is 1, the children of n are 2 n and 2 n + 1.
struct Branch {
  size_t node, first, last;

  bool is_leaf() const { return last - first == 1; }
  Branch left() const { return {2 * node, first, first + (last - first) / 2}; }
  Branch right() const { return {2 * node + 1, first + (last - first) / 2, last}; }
};

class BrickTree {
 public:
  /// bricks: at least one, less than 2^32. They are copied.
  static Result<BrickTree> build(std::span<const Brick> bricks, const KeySpace& space, const Context& ctx);
  /// Of memory, for each brick.
  static constexpr uint64_t bytes_per_brick = sizeof(Brick) + sizeof(Leaf) / leaf_bricks + 14;
  /// While it is built, as well.
  static constexpr uint64_t bytes_to_build = sizeof(Key) + 8;

  /// Bricks are at positions 0 .. size() - 1, in the order of the leaves; all leaves but the last are full.
  size_t size() const { return order_.size(); }
  size_t leaves() const { return leaves_.size(); }
  /// Numbers of nodes are below this.
  size_t nodes() const { return boxes_.size(); }
  Branch root() const { return {1, 0, leaves()}; }
  /// Branches that share no node and have all leaves: at most `count`, as many as there are on one level.
  std::vector<Branch> branches(size_t count) const;

  /// Which of the bricks that the tree was built of is at a position.
  uint32_t index(size_t position) const { return order_[position]; }
  const Brick& brick(size_t position) const { return bricks_[position]; }
  uint32_t norm(size_t position) const { return norms_[position]; }
  Key key(size_t position) const;
  const Leaf& leaf(size_t leaf) const { return leaves_[leaf]; }
  /// One bit for each brick of a leaf.
  uint32_t present(size_t leaf) const {
    const size_t count = size() - leaf * leaf_bricks;
    return count >= leaf_bricks ? ~0u : (1u << count) - 1;
  }
  const Brick* leaf_bricks_of(size_t leaf) const { return bricks_.data() + leaf * leaf_bricks; }
  const uint32_t* leaf_norms(size_t leaf) const { return norms_.data() + leaf * leaf_bricks; }
  const KeyBox& box(size_t node) const { return boxes_[node]; }

  /// Puts another brick at a position. Boxes grow and never shrink: after many, a new tree is faster.
  void replace(size_t position, const Brick& brick, const Key& key);

 private:
  struct Builder;
  void place(size_t position, const Brick& brick, const Key& key);

  std::vector<uint32_t> order_;
  std::vector<Brick> bricks_;
  std::vector<Leaf> leaves_;
  std::vector<uint32_t> norms_;  // of the keys; whole leaves
  std::vector<int16_t> rests_;   // the last coarse coordinates; the others are fine ones, too
  std::vector<KeyBox> boxes_;
};

}  // namespace voxkit::vq
