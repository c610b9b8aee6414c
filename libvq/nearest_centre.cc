#include "libvq/nearest_centre.h"

#include <atomic>

#include "formats/parallel.h"

namespace voxkit::vq {
namespace {

/// Bricks, each looking for the nearest of the queries.
struct CentreFinder {
  NearestCentres& nearest;
  const KeySpace& space;
  uint32_t first;

  int32_t reach(size_t node) const {
    const int32_t reach = nearest.reaches.below(node);
    return reach == 0 ? -1 : reach;
  }
  const uint32_t* edges(size_t leaf) const { return nearest.reaches.edges(leaf); }
  void found(size_t position, uint32_t query, uint64_t distance) {
    if (distance >= nearest.distance[position]) return;
    nearest.distance[position] = distance;
    nearest.centre[position] = first + query;
    nearest.reaches.set(position, space.reach(distance));
  }
  void leave(const Branch& branch) { nearest.reaches.gather(branch); }
};

}  // namespace

Reaches::Reaches(const BrickTree& tree) : tree_(&tree), nodes_(tree.nodes()) {
  edges_.assign(tree.leaf_norms(0), tree.leaf_norms(0) + tree.leaves() * leaf_bricks);
}

void Reaches::gather(const Branch& branch) {
  int32_t greatest = 0;
  if (branch.is_leaf()) {
    const uint32_t* norms = tree_->leaf_norms(branch.first);
    for (size_t i = 0; i < leaf_bricks; ++i)
      greatest = std::max(greatest, static_cast<int32_t>(norms[i] - edges(branch.first)[i]));
  } else {
    greatest = std::max(nodes_[branch.left().node], nodes_[branch.right().node]);
  }
  nodes_[branch.node] = greatest;
}

void Reaches::gather_all(const Branch& branch) {
  if (!branch.is_leaf()) {
    gather_all(branch.left());
    gather_all(branch.right());
  }
  gather(branch);
}

void Reaches::gather_above(size_t level) {
  for (size_t node = level; --node > 0;) nodes_[node] = std::max(nodes_[2 * node], nodes_[2 * node + 1]);
}

Result<NearestCentres> NearestCentres::build(std::span<const Brick> bricks, const KeySpace& space,
                                             bool native, const Context& ctx) {
  VOX_TRY(BrickTree built, BrickTree::build(bricks, space, ctx));
  auto tree = std::make_unique<BrickTree>(std::move(built));
  Reaches reaches(*tree);
  NearestCentres nearest{&search_kernels(native, space.narrow()),
                         std::move(tree),
                         std::move(reaches),
                         std::vector<uint64_t>(bricks.size(), ~uint64_t{0}),
                         std::vector<uint32_t>(bricks.size()),
                         std::vector<SearchSpace>(static_cast<size_t>(ctx.threads))};
  for (size_t i = 0; i < bricks.size(); ++i) nearest.reaches.set(i, space.reach(~uint64_t{0}));
  nearest.reaches.gather_all(nearest.tree->root());
  return nearest;
}

Status NearestCentres::add(std::span<const Brick> centres, uint32_t first, const KeySpace& space,
                           const Context& ctx) {
  QueryBlock queries;
  for (const Brick& brick : centres) queries.add(space.key(brick), brick, 0);
  CentreFinder finder{*this, space, first};
  return search_all(queries, finder, ctx);
}

Status NearestCentres::for_each_branch(
    const Context& ctx, const std::function<Status(size_t worker, const Branch& branch)>& body) {
  const std::vector<Branch> branches = tree->branches(256);
  std::atomic<size_t> next{0};
  VOX_CHECK(parallel_for(ctx, ctx.threads, [&](int64_t worker) -> Status {
    for (size_t i; (i = next++) < branches.size();) {
      VOX_CHECK(check_interrupt());
      VOX_CHECK(body(static_cast<size_t>(worker), branches[i]));
    }
    return {};
  }));
  reaches.gather_above(branches.size());
  return {};
}

}  // namespace voxkit::vq
