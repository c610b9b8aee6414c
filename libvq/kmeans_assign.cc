#include "libvq/kmeans_assign.h"

#include <algorithm>
#include <atomic>

#include "formats/parallel.h"

namespace voxkit::vq {
namespace {

/// How far a brick looks for other centres than its own, which is at this distance: a bit further than it
/// must, so that it need not look again as soon as its own moves away a bit.
uint64_t radius(uint64_t distance) {
  return distance + distance / 8;
}

}  // namespace

Assigner::Assigner(NearestCentres& nearest, const KeySpace& space)
    : nearest_(nearest), space_(space), others_(nearest.distance), before_(nearest.centre) {}

/// A brick learns how far a centre is. Returns whether it looks less far now.
bool Assigner::consider(size_t position, uint32_t centre, uint64_t distance) {
  uint64_t& own = nearest_.distance[position];
  uint32_t& owner = nearest_.centre[position];
  uint64_t& others = others_[position];
  const uint64_t was = others;
  if (centre == owner) return false;
  if (distance < own || (distance == own && owner != before_[position] && centre < owner)) {
    others = std::min({others, own, radius(distance)});
    own = distance;
    owner = centre;
  } else {
    others = std::min(others, distance);
  }
  return others != was;
}

/// Bricks look for centres that moved.
struct Assigner::ChangedFinder {
  Assigner& assigner;
  std::span<const uint32_t> numbers;  // of the centres that are queries

  int32_t reach(size_t node) const {
    const int32_t reach = assigner.nearest_.reaches.below(node);
    return reach == 0 ? -1 : reach;
  }
  const uint32_t* edges(size_t leaf) const { return assigner.nearest_.reaches.edges(leaf); }
  void found(size_t position, uint32_t query, uint64_t distance) {
    if (assigner.consider(position, numbers[query], distance))
      assigner.nearest_.reaches.set(position, assigner.space_.reach(assigner.others_[position]));
  }
  void leave(const Branch& branch) { assigner.nearest_.reaches.gather(branch); }
};

/// Bricks, as queries, look for centres.
struct Assigner::AllFinder {
  Assigner& assigner;
  std::span<const uint32_t> positions;  // of the bricks that are queries

  int32_t reach(size_t) const { return 0; }
  const uint32_t* edges(size_t leaf) const { return assigner.tree_->leaf_norms(leaf); }
  void found(size_t position, uint32_t query, uint64_t distance) {
    assigner.consider(positions[query], assigner.tree_->index(position), distance);
  }
  void leave(const Branch&) {}
};

Status Assigner::assign(std::span<const Brick> centres, std::span<const uint32_t> changed,
                        const Context& ctx) {
  before_ = nearest_.centre;
  moved_.assign(centres.size(), 0);
  for (const uint32_t c : changed) moved_[c] = 1;
  VOX_CHECK(follow(centres, ctx));
  VOX_CHECK(look_at_changed(centres, changed, ctx));
  move_in_tree(centres, changed);
  return look_at_all(centres, ctx);
}

/// Where centres moved, how far are they now from their bricks?
Status Assigner::follow(std::span<const Brick> centres, const Context& ctx) {
  std::vector<std::vector<uint32_t>> further(static_cast<size_t>(ctx.threads));
  VOX_CHECK(nearest_.for_each_branch(ctx, [&](size_t worker, const Branch& branch) -> Status {
    follow_branch(centres, branch, further[worker]);
    return {};
  }));
  further_.clear();
  for (const std::vector<uint32_t>& part : further) further_.insert(further_.end(), part.begin(), part.end());
  std::sort(further_.begin(), further_.end());
  return {};
}

void Assigner::follow_branch(std::span<const Brick> centres, const Branch& branch,
                             std::vector<uint32_t>& further) {
  if (!branch.is_leaf()) {
    follow_branch(centres, branch.left(), further);
    follow_branch(centres, branch.right(), further);
    return nearest_.reaches.gather(branch);
  }
  bool touched = false;
  const size_t begin = branch.first * leaf_bricks, end = std::min(begin + leaf_bricks, nearest_.tree->size());
  for (size_t p = begin; p < end; ++p) {
    if (!moved_[nearest_.centre[p]]) continue;
    touched = true;
    uint64_t& distance = nearest_.distance[p];
    nearest_.kernels->distances(&nearest_.tree->brick(p), 1, centres[nearest_.centre[p]], &distance);
    // What equals its centre looks for nothing, and so will have to look again when that moves on.
    const bool too_far = distance > others_[p];
    if (too_far) further.push_back(static_cast<uint32_t>(p));
    others_[p] = too_far ? radius(distance) : std::min(others_[p], radius(distance));
    nearest_.reaches.set(p, space_.reach(others_[p]));
  }
  if (touched) nearest_.reaches.gather(branch);
}

Status Assigner::look_at_changed(std::span<const Brick> centres, std::span<const uint32_t> changed,
                                 const Context& ctx) {
  while (!changed.empty()) {
    const std::span<const uint32_t> numbers = changed.first(std::min(changed.size(), QueryBlock::most));
    changed = changed.subspan(numbers.size());
    QueryBlock queries;
    for (const uint32_t c : numbers) queries.add(space_.key(centres[c]), centres[c], 0);
    ChangedFinder finder{*this, numbers};
    VOX_CHECK(nearest_.search_all(queries, finder, ctx));
  }
  return {};
}

/// Keeps the tree of centres, once there is one, as they are.
void Assigner::move_in_tree(std::span<const Brick> centres, std::span<const uint32_t> changed) {
  if (tree_ == nullptr) return;
  moves_ += changed.size();
  for (const uint32_t c : changed) tree_->replace(place_[c], centres[c], space_.key(centres[c]));
}

Status Assigner::look_at_all(std::span<const Brick> centres, const Context& ctx) {
  if (further_.empty()) return {};
  if (tree_ == nullptr || moves_ > centres.size() / 2) {
    tree_.reset();
    VOX_TRY(BrickTree built, BrickTree::build(centres, space_, ctx));
    tree_ = std::make_unique<BrickTree>(std::move(built));
    place_.resize(centres.size());
    for (uint32_t p = 0; p < centres.size(); ++p) place_[tree_->index(p)] = p;
    moves_ = 0;
  }
  constexpr size_t block = 256;
  std::atomic<size_t> next{0};
  return parallel_for(ctx, ctx.threads, [&](int64_t worker) -> Status {
    QueryBlock queries;
    for (size_t begin; (begin = block * next++) < further_.size();) {
      VOX_CHECK(check_interrupt());
      const auto positions = std::span(further_).subspan(begin, std::min(block, further_.size() - begin));
      queries.clear();
      for (const uint32_t p : positions) {
        queries.add(nearest_.tree->key(p), nearest_.tree->brick(p), space_.reach(others_[p]));
      }
      AllFinder finder{*this, positions};
      search(*tree_, *nearest_.kernels, tree_->root(), queries, queries.rows(),
             nearest_.spaces[static_cast<size_t>(worker)], 0, finder);
      for (const uint32_t p : positions) nearest_.reaches.set(p, space_.reach(others_[p]));
    }
    return {};
  });
}

}  // namespace voxkit::vq
