// Walking through the leaf words that have colours of a range of numbers, in their order. What has none of
// them is not entered.
#pragma once

#include "libcolor/dag/box_walk.h"

namespace voxkit::color {

/// Of a DAG whose voxels alone have colours, in Morton order.
class ColorWalk {
 public:
  /// Colours with numbers from `first` on, below `last`.
  ColorWalk(const DagView& view, uint64_t first, uint64_t last) : view_(view), first_(first), last_(last) {}

  /// Calls visit(word, corner, color) with the words that have such colours, and the number of their first
  /// one, until it returns false. False if it did, or a node is not as it should be.
  template <class Visit>
  bool run(uint64_t colors, const Visit& visit) const {
    return cell({view_.height, view_.root, Index3(0), 0, first_state(view_.curve)}, colors, visit);
  }

 private:
  /// `end`: behind the cell's colours.
  template <class Visit>
  bool cell(const WalkedCell& at, uint64_t end, const Visit& visit) const {
    if (at.height == leaf_height) return visit(view_.leaf(at.pointer), at.corner, at.color);
    const NodeRef node = view_.node(at.height, at.pointer);
    if (node.mask == 0) return false;
    const int64_t side = int64_t{1} << (at.height - 1);
    const auto children = children_of(view_, node, at.height, at.state);
    bool entered = false;  // else a node with no end of them could be gone through in vain
    for (uint32_t left = node.mask; left != 0; left &= left - 1) {
      const auto octant = static_cast<uint32_t>(std::countr_zero(left));
      const uint32_t behind = left & (left - 1);
      const uint64_t color = at.color + children[octant].colors_before;
      const uint64_t child_end =
          behind == 0 ? end
                      : at.color + children[static_cast<size_t>(std::countr_zero(behind))].colors_before;
      if (color >= last_ || child_end <= first_) continue;
      entered = true;
      if (!cell({at.height - 1, children[octant].pointer, octant_corner(at.corner, octant, side), color,
                 at.state},
                child_end, visit))
        return false;
    }
    return entered;
  }

  const DagView& view_;
  uint64_t first_, last_;
};

}  // namespace voxkit::color
