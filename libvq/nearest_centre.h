// Bricks, each with the nearest of the centres that there have been so far.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "libvq/nearest_search.h"
#include "libvq/nearest_tree.h"

namespace voxkit::vq {

/// How far each brick of a tree looks, and the furthest below each node.
class Reaches {
 public:
  explicit Reaches(const BrickTree& tree);
  /// Of one brick, before `gather` of its leaf.
  void set(size_t position, int32_t reach) {
    edges_[position] = tree_->norm(position) - static_cast<uint32_t>(reach);
  }
  int32_t of(size_t position) const { return static_cast<int32_t>(tree_->norm(position) - edges_[position]); }
  const uint32_t* edges(size_t leaf) const { return edges_.data() + leaf * leaf_bricks; }
  int32_t below(size_t node) const { return nodes_[node]; }
  /// The node's from what is below it: bricks, or its children.
  void gather(const Branch& branch);
  /// All nodes' from those of the bricks; for a branch and what is below it.
  void gather_all(const Branch& branch);
  /// Those of the nodes above a level of so many branches.
  void gather_above(size_t level);

 private:
  const BrickTree* tree_;
  std::vector<uint32_t> edges_;
  std::vector<int32_t> nodes_;
};

/// By position in the tree.
struct NearestCentres {
  static Result<NearestCentres> build(std::span<const Brick> bricks, const KeySpace& space, bool native,
                                      const Context& ctx);
  /// Of memory, for each brick, beside the tree.
  static constexpr uint64_t bytes_per_brick = 8 + 4 + 4;

  /// Looks whether these centres, numbered from `first` on, are nearer. Where several are equally near, the
  /// first stays. At most QueryBlock::most at a time.
  Status add(std::span<const Brick> centres, uint32_t first, const KeySpace& space, const Context& ctx);

  /// Calls body(worker, branch) for branches that together have all leaves, side by side; no two calls with
  /// the same worker, 0 .. ctx.threads - 1, are at the same time. Then gathers the reaches above them.
  Status for_each_branch(const Context& ctx,
                         const std::function<Status(size_t worker, const Branch& branch)>& body);
  /// `search` on all threads.
  template <class Finder>
  Status search_all(const QueryBlock& queries, Finder& finder, const Context& ctx) {
    return for_each_branch(ctx, [&](size_t worker, const Branch& branch) -> Status {
      search(*tree, *kernels, branch, queries, queries.rows(), spaces[worker], 0, finder);
      return {};
    });
  }

  const Kernels* kernels;
  std::unique_ptr<BrickTree> tree;  // Reaches point there
  Reaches reaches;                  ///< of a brick, how far the nearest centre is
  std::vector<uint64_t> distance;   ///< squared
  std::vector<uint32_t> centre;
  std::vector<SearchSpace> spaces;  ///< for each worker
};

}  // namespace voxkit::vq
