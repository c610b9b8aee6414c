// What cells have, from that of the voxels in Morton order to the order of a file: along its curve, for nodes
// as well where they have any.
#pragma once

#include <array>
#include <bit>

#include "libcolor/dag/dag_view.h"

namespace voxkit::color {

/// Goes through a DAG from DagBuilder along a curve, as FORMAT.md numbers colours. `Out` gathers what there
/// is:
/// - `Sums`, which can be added to by its function `add(const Sums&)`;
/// - `Sums voxel(uint64_t first)` appends that of a voxel, a number in Morton order;
/// - `size_t begin()` makes room for that of a cell, before those below it;
/// - `void end(size_t room, int height, Sums& sums)` fills it with what is below.
template <class Out>
class CellOrder {
 public:
  CellOrder(const Dag& dag, Out& out) : view_(view_of(dag)), out_(out) {}
  void run(Curve curve) { node(view_.height, view_.root, first_state(curve), 0); }

 private:
  using Sums = typename Out::Sums;

  /// A node, and the number of its first voxel in Morton order.
  Sums node(int h, uint32_t pointer, OrderState state, uint64_t first) {
    if (h == leaf_height) return word(view_.leaf(pointer), state, first);
    const size_t own = out_.begin();
    const NodeRef ref = view_.node(h, pointer);
    struct Child {
      uint32_t pointer;
      uint64_t first;
    };
    std::array<Child, 8> children;  // by octant
    for (uint32_t octant = 0; octant < 8; ++octant) {
      if (!ref.has(octant)) continue;
      children[octant] = {view_.pointer(ref, octant), first};
      first += view_.colors_below(h - 1, children[octant].pointer);
    }
    Sums sums{};
    for (const uint8_t octant : octant_orders.octant[state])
      if (ref.has(octant))
        sums.add(
            node(h - 1, children[octant].pointer, octant_orders.next[state][octant], children[octant].first));
    out_.end(own, h, sums);
    return sums;
  }

  Sums word(uint64_t leaf, OrderState state, uint64_t first) {
    const size_t own = out_.begin();
    Sums sums{};
    for (const uint8_t octant : octant_orders.octant[state]) {
      if ((leaf >> 8 * octant & 0xff) == 0) continue;
      const size_t own_octant = out_.begin();
      Sums below{};
      for (const uint8_t voxel : octant_orders.octant[octant_orders.next[state][octant]]) {
        const uint64_t bit = uint64_t{1} << (8 * octant + voxel);
        if ((leaf & bit) != 0)
          below.add(out_.voxel(first + static_cast<uint64_t>(std::popcount(leaf & (bit - 1)))));
      }
      out_.end(own_octant, leaf_height - 1, below);
      sums.add(below);
    }
    out_.end(own, leaf_height, sums);
    return sums;
  }

  const DagView view_;
  Out& out_;
};

}  // namespace voxkit::color
