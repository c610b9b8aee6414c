// A brick's distance never grows as centres come, so what it was bounds what it is. Centres are therefore
// chosen many at a time: of the bricks that were furthest, each is looked at again, against the new centres
// only, when its turn comes; none of the others can be further as long as what is chosen is further than they
// were. Then all bricks learn of the new centres at once, side by side.
#include <algorithm>

#include "libvq/seeding.h"

namespace voxkit::vq {
namespace {

struct Candidate {
  uint64_t distance;  // an upper bound ...
  uint32_t index;     // which brick
  uint32_t position;  // and where it is in the tree
  size_t seen;        // ... that takes so many of the recent centres into account

  /// For heaps: the furthest on top, of those the first.
  bool operator<(const Candidate& other) const {
    return distance < other.distance || (distance == other.distance && index > other.index);
  }
};

class FurthestFirst {
 public:
  FurthestFirst(NearestCentres& nearest, const KeySpace& space, uint32_t count, std::vector<Brick>& centres)
      : nearest_(nearest), space_(space), count_(count), centres_(centres), recent_(*nearest.kernels) {}

  Status run(Context& ctx) {
    centres_.reserve(count_);  // recent_ has pointers
    recent_.restart(centres_);
    choose(nearest_to_origin());
    VOX_CHECK(tell(ctx));
    while (centres_.size() < count_ && nearest_.reaches.below(1) > 0) {
      choose_some();
      VOX_CHECK(tell(ctx));
      ctx.progress(static_cast<double>(centres_.size()) / count_);
    }
    return {};
  }

 private:
  size_t nearest_to_origin() const {
    Candidate best{~uint64_t{0}, 0, 0, 0};
    for (uint32_t position = 0; position < nearest_.tree->size(); ++position) {
      uint64_t distance = 0;
      for (const uint16_t v : nearest_.tree->brick(position)) distance += uint64_t{v} * v;
      const Candidate here{distance, nearest_.tree->index(position), position, 0};
      if (here.distance < best.distance || (here.distance == best.distance && here.index < best.index))
        best = here;
    }
    return best.position;
  }

  void choose(size_t position) {
    centres_.push_back(nearest_.tree->brick(position));
    recent_.add(nearest_.tree->key(position));
  }

  /// All bricks that look at least `reach` far.
  void collect(const Branch& branch, int32_t reach) {
    const Reaches& reaches = nearest_.reaches;
    if (reaches.below(branch.node) < reach) return;
    if (!branch.is_leaf()) {
      collect(branch.left(), reach);
      collect(branch.right(), reach);
      return;
    }
    const BrickTree& tree = *nearest_.tree;
    for (size_t p = branch.first * leaf_bricks; p < std::min(branch.last * leaf_bricks, tree.size()); ++p)
      if (reaches.of(p) >= reach)
        candidates_.push_back({nearest_.distance[p], tree.index(p), static_cast<uint32_t>(p), 0});
  }

  void choose_some() {
    const int32_t furthest = nearest_.reaches.below(1);
    const int32_t reach = std::max(1, static_cast<int32_t>(furthest * share_));
    candidates_.clear();
    collect(nearest_.tree->root(), reach);
    // Comes before all that is not among the candidates and looks as far.
    Candidate left_out{0, ~0u, 0, 0};
    if (candidates_.size() > 2 * wanted) {
      const auto nth = candidates_.begin() + wanted;
      std::nth_element(candidates_.begin(), nth, candidates_.end(),
                       [](const Candidate& a, const Candidate& b) { return b < a; });
      left_out = *nth;
      candidates_.erase(nth, candidates_.end());
      share_ = 1 - (1 - share_) * 0.7;
    } else if (candidates_.size() < wanted) {
      share_ = std::max(0.3, 1 - (1 - share_) * 1.3);
    }
    std::make_heap(candidates_.begin(), candidates_.end());
    while (!candidates_.empty() && centres_.size() < count_ && recent_.size() < RecentCentres::most) {
      std::pop_heap(candidates_.begin(), candidates_.end());
      Candidate top = candidates_.back();
      candidates_.pop_back();
      if (top.seen == recent_.size()) {
        choose(top.position);
        continue;
      }
      top.distance = recent_.nearest(nearest_.tree->brick(top.position), nearest_.tree->key(top.position),
                                     top.distance, top.seen, space_);
      top.seen = recent_.size();
      if (top < left_out || space_.reach(top.distance) < reach) continue;
      candidates_.push_back(top);
      std::push_heap(candidates_.begin(), candidates_.end());
    }
  }

  Status tell(const Context& ctx) {
    const size_t first = centres_.size() - recent_.size();
    VOX_CHECK(nearest_.add(std::span(centres_).subspan(first), static_cast<uint32_t>(first), space_, ctx));
    recent_.restart(centres_);
    return {};
  }

  static constexpr ptrdiff_t wanted = 6 * RecentCentres::most;  // candidates
  NearestCentres& nearest_;
  const KeySpace& space_;
  uint32_t count_;
  std::vector<Brick>& centres_;
  RecentCentres recent_;
  std::vector<Candidate> candidates_;
  double share_ = 0.9;  // of the greatest reach: where there are about as many candidates as wanted
};

}  // namespace

Status seed_furthest(NearestCentres& nearest, const KeySpace& space, uint32_t count,
                     std::vector<Brick>& centres, Context& ctx) {
  return FurthestFirst(nearest, space, count, centres).run(ctx);
}

}  // namespace voxkit::vq
