// Walking through the cells of a surface that touch a box, in Morton order. What is outside, and what is
// void, is not entered.
#pragma once

#include <algorithm>
#include <array>

#include "formats/volume.h"
#include "libcolor/dag/dag_view.h"
#include "libcolor/dag/void_search.h"

namespace voxkit::color {

inline Index3 octant_corner(Index3 corner, uint32_t octant, int64_t side) {
  return corner + Index3(octant & 1, octant >> 1 & 1, octant >> 2) * side;
}

/// The children of a node of height h that is gone through in a state, by octant. Where counts are in nodes
/// those of the octants before are added up, each once.
inline std::array<ChildRef, 8> children_of(const DagView& view, const NodeRef& node, int h,
                                           OrderState state) {
  std::array<ChildRef, 8> children;
  uint64_t before = view.colors == Colors::all ? 1 : 0;
  for (const uint8_t octant : octant_orders.octant[state]) {
    if (!node.has(octant)) continue;
    if (view.counts == Counts::pointer) {
      children[octant] = view.child(node, h, octant, state);
      continue;
    }
    children[octant] = {view.pointer(node, octant), before};
    before += view.colors_below(h - 1, children[octant].pointer);
  }
  return children;
}

/// The bits of a leaf word at `corner` whose voxels are inside a box.
inline uint64_t leaf_within(Index3 corner, const Box& box) {
  uint64_t bits = ~uint64_t{0};
  for (int a = 0; a < 3; ++a) {
    const auto from = static_cast<size_t>(std::clamp<int64_t>(box.lo[a] - corner[a], 0, 4));
    const auto to = static_cast<size_t>(std::clamp<int64_t>(box.hi[a] - corner[a], 0, 4));
    bits &= leaf_slabs[static_cast<size_t>(a)][from][std::max(from, to)];
  }
  return bits;
}

/// A cell that a walk comes to: a node, or a leaf word.
struct WalkedCell {
  int height;
  uint32_t pointer;
  Index3 corner;
  uint64_t color;    ///< the number of its first one
  OrderState state;  ///< how it is gone through
};

class BoxWalk {
 public:
  /// `stop`: the height, leaf_height or above, of cells that are not entered any more.
  BoxWalk(const DagView& view, const Box& box, int stop = leaf_height)
      : view_(view), box_(box), stop_(std::max(stop, leaf_height)) {}

  /// Calls `visit` with the cells of height `stop` that touch the box; it says whether to go on. False where
  /// it did not, or a node is missing or has no octants.
  template <class Visit>
  bool run(const Visit& visit) const {
    return cell({view_.height, view_.root, Index3(0), 0, first_state(view_.curve)}, visit);
  }

 private:
  template <class Visit>
  bool cell(const WalkedCell& at, const Visit& visit) const {
    if (at.height <= stop_) return visit(at);
    const NodeRef node = view_.node(at.height, at.pointer);
    if (node.mask == 0) return false;
    const int64_t side = int64_t{1} << (at.height - 1);
    const auto children = children_of(view_, node, at.height, at.state);
    for (uint32_t octant = 0; octant < 8; ++octant) {
      const Index3 corner = octant_corner(at.corner, octant, side);
      if (node.has(octant) && !intersect({corner, corner + side}, box_).empty() &&
          !cell({at.height - 1, children[octant].pointer, corner, at.color + children[octant].colors_before,
                 octant_orders.next[at.state][octant]},
                visit))
        return false;
    }
    return true;
  }

  const DagView& view_;
  Box box_;
  int stop_;
};

}  // namespace voxkit::color
