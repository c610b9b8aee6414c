// Reading a DAG, wherever its words are: in memory, in a mapped file, on a device. Safe on any words: a
// pointer that leads outside is never followed.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

#include "formats/hd.h"
#include "libcolor/dag/dag.h"
#include "libcolor/dag/symmetric_node.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// A node that has been looked up.
struct NodeRef {
  uint32_t mask = 0;  ///< which octants there are
  bool there = false;
  const uint32_t* words = nullptr;  ///< of a DAG without symmetry; of one with it:
  uint32_t codes = 0, mirror = 0;
  uint64_t starts = 0;  ///< where pointers begin among the children, a byte for each octant as it is stored
  const uint8_t *children = nullptr,
                *end = nullptr;          ///< what its octants have; the end of its height's bytes
  const uint8_t* above_words = nullptr;  ///< above leaf words: the height's first byte

  VOX_HD bool has(uint32_t octant) const { return mask >> octant & 1; }
  /// Octants that have a word in the node, by the lower bits of their codes.
  VOX_HD uint32_t words_of_codes() const { return above_words != nullptr ? codes & codes >> 1 & 0x5555 : 0; }
};

/// A child on the way down.
struct ChildRef {
  uint32_t pointer = 0;
  uint64_t colors_before = 0;  ///< of the node's, before the child's first one
};

struct DagView {
  int height = leaf_height;
  Colors colors = Colors::leaf;
  Counts counts = Counts::node;
  Curve curve = Curve::morton;
  uint32_t root = 0;
  const uint64_t* leaves = nullptr;
  uint64_t leaf_count = 0;
  std::array<const uint32_t*, most_levels + 1> nodes{};  ///< by height
  std::array<uint64_t, most_levels + 1> words{};
  // Instead, with symmetry (symmetric_node.h):
  bool symmetric = false;
  std::array<const uint8_t*, most_levels + 1> coded{};  ///< by height
  std::array<uint64_t, most_levels + 1> coded_bytes{};

  /// The leaf word that a pointer leads to; 0 if there is none.
  VOX_HD uint64_t leaf(uint32_t pointer) const {
    return symmetric              ? mirrored_word(stored_word(pointer), pointer >> mirror_shift)
           : pointer < leaf_count ? leaves[pointer]
                                  : 0;
  }

  /// The node of this height, above leaf_height, that a pointer leads to.
  VOX_HD NodeRef node(int h, uint32_t pointer) const {
    const auto at = static_cast<size_t>(h);
    if (symmetric) return symmetric_node(h, pointer);
    if (pointer >= words[at]) return {};
    const uint32_t* const first = nodes[at] + pointer;
    const uint32_t mask = *first & 0xff;
    const uint32_t length = node_words(count_octants(mask), *first >> 8 == wide_count, counts);
    if (length > words[at] - pointer) return {};
    NodeRef ref;
    ref.mask = mask;
    ref.there = true;
    ref.words = first;
    return ref;
  }

  /// How many colours there are in a subtree of this height.
  VOX_HD uint64_t colors_below(int h, uint32_t pointer) const {
    if (h == leaf_height) return leaf_colors(symmetric ? stored_word(pointer) : leaf(pointer), colors);
    const auto at = static_cast<size_t>(h);
    if (symmetric) {
      const uint32_t address = pointer & address_mask;
      if (coded_bytes[at] < 3 || address > coded_bytes[at] - 3) return 0;
      return count_at(coded[at] + address + 2, coded[at] + coded_bytes[at]).colors;
    }
    if (pointer >= words[at]) return 0;
    const uint32_t* const first = nodes[at] + pointer;
    const uint32_t count = *first >> 8;
    if (count != wide_count) return count;
    const NodeRef ref = node(h, pointer);
    if (!ref.there) return 0;
    const uint32_t* const wide = first + 1 + count_octants(ref.mask);
    return wide[0] | static_cast<uint64_t>(wide[1]) << 32;
  }

  /// The pointer to what an octant that is there has.
  VOX_HD uint32_t pointer(const NodeRef& node, uint32_t octant) const {
    if (symmetric) return symmetric_pointer(node, octant);
    const uint32_t i = count_octants(node.mask & ((1u << octant) - 1));
    return node.words[1 + (counts == Counts::pointer ? 2 * i : i)];
  }

  /// The child in an octant that is there, of a node of this height that is gone through in a state.
  ChildRef child(const NodeRef& node, int h, uint32_t octant, OrderState state) const {
    if (counts == Counts::pointer)
      return {pointer(node, octant), node.words[2 + 2 * count_octants(node.mask & ((1u << octant) - 1))]};
    if (symmetric) return symmetric_child(node, h, octant, octant_orders.before[state][octant]);
    uint64_t before = colors == Colors::all ? 1 : 0;
    for (uint32_t left = node.mask & octant_orders.before[state][octant]; left != 0; left &= left - 1)
      before += colors_below(h - 1, pointer(node, static_cast<uint32_t>(std::countr_zero(left))));
    return {pointer(node, octant), before};
  }

  /// Where the octants of a node with symmetry end; not before `end` if it is cut off.
  VOX_HD static const uint8_t* behind_octants(const NodeRef& node) {
    return behind_words(node, node.words_of_codes());
  }

 private:
  /// A leaf word as it is stored.
  VOX_HD uint64_t stored_word(uint32_t pointer) const {
    const uint32_t address = pointer & address_mask;
    if ((address & word_in_node) == 0) return address < leaf_count ? leaves[address] : 0;
    const uint32_t byte = address & ~word_in_node;
    const uint64_t bytes = coded_bytes[leaf_height + 1];
    const uint8_t* const first = coded[leaf_height + 1];
    return byte < bytes ? word_at(first + byte, first + bytes) : 0;
  }
  VOX_HD NodeRef symmetric_node(int h, uint32_t pointer) const {
    const auto at = static_cast<size_t>(h);
    const uint32_t address = pointer & address_mask;
    if (coded_bytes[at] < 3 || address > coded_bytes[at] - 3) return {};
    const uint8_t* const first = coded[at] + address;
    NodeRef ref;
    ref.there = true;
    ref.codes = first[0] | static_cast<uint32_t>(first[1]) << 8;
    ref.mirror = pointer >> mirror_shift;
    ref.mask = mirrored_octants(octants_of_codes(ref.codes), ref.mirror);
    ref.starts = pointer_starts(ref.codes);
    ref.end = coded[at] + coded_bytes[at];
    ref.children = count_at(first + 2, ref.end).behind;
    if (h == leaf_height + 1) {
      ref.above_words = coded[at];
      ref.starts = pointer_starts(ref.codes & ~(3 * ref.words_of_codes()));
    }
    return ref;
  }
  VOX_HD uint32_t symmetric_pointer(const NodeRef& node, uint32_t octant) const {
    const uint32_t stored = octant ^ node.mirror, code = node.codes >> 2 * stored & 3;
    if (code == code_other && node.above_words != nullptr)
      return node.mirror << mirror_shift | word_in_node |
             static_cast<uint32_t>(behind_words(node, node.words_of_codes() & ((1u << 2 * stored) - 1)) -
                                   node.above_words);
    return pointer_at(node, node.children + (node.starts >> 8 * stored & 0xff), code);
  }
  /// The pointer of this code that begins at a byte; one that leads nowhere if it is cut off.
  VOX_HD static uint32_t pointer_at(const NodeRef& node, const uint8_t* at, uint32_t code) {
    constexpr uint32_t nowhere = ~0u;
    if (at > node.end || node.end - at < static_cast<ptrdiff_t>(code + 1)) return nowhere;
    uint32_t pointer;
    if (node.end - at >= 4) {  // in one load
      pointer = at[0] | static_cast<uint32_t>(at[1]) << 8 | static_cast<uint32_t>(at[2]) << 16 |
                static_cast<uint32_t>(at[3]) << 24;
      pointer &= ~0u >> (24 - 8 * code);
    } else {
      pointer = at[0] | static_cast<uint32_t>(at[1]) << 8;
      if (code == code_long) pointer |= static_cast<uint32_t>(at[2]) << 16;
    }
    return ((pointer & 7) ^ node.mirror) << mirror_shift | pointer >> 3;
  }
  /// The same as `child`, in one way along the node; `before`: the octants whose colours come before.
  ChildRef symmetric_child(const NodeRef& node, int h, uint32_t octant, uint32_t before) const {
    const uint32_t wanted = mirrored_octants(before | 1u << octant, node.mirror), own = octant ^ node.mirror;
    const uint32_t in_node = node.words_of_codes();
    ChildRef child{~0u, colors == Colors::all ? uint64_t{1} : 0};
    const auto take = [&](uint32_t stored, uint32_t pointer) {
      if (stored == own)
        child.pointer = pointer;
      else
        child.colors_before += colors_below(h - 1, pointer);
    };
    const uint8_t* at = node.children;
    for (uint32_t left = (node.codes | node.codes >> 1) & 0x5555 & ~in_node; left != 0; left &= left - 1) {
      const auto stored = static_cast<uint32_t>(std::countr_zero(left)) / 2;
      const uint32_t code = node.codes >> 2 * stored & 3;
      if ((wanted >> stored & 1) != 0) take(stored, pointer_at(node, at, code));
      at += code + 1;
    }
    for (uint32_t left = in_node; left != 0 && at < node.end; left &= left - 1) {
      const auto stored = static_cast<uint32_t>(std::countr_zero(left)) / 2;
      if ((wanted >> stored & 1) != 0)
        take(stored,
             node.mirror << mirror_shift | word_in_node | static_cast<uint32_t>(at - node.above_words));
      at += 1 + count_octants(*at);
    }
    return child;
  }
  /// Where these words of a node end, its first ones.
  VOX_HD static const uint8_t* behind_words(const NodeRef& node, uint32_t in_node) {
    const uint8_t* at = node.children + pointer_bytes_of(node.codes & ~(3 * node.words_of_codes()));
    for (; in_node != 0 && at < node.end; in_node &= in_node - 1) at += 1 + count_octants(*at);
    return at;
  }
};

/// A DAG in memory, as a view of it.
inline DagView view_of(const Dag& dag) {
  DagView view;
  view.height = dag.height;
  view.colors = dag.colors;
  view.counts = dag.counts;
  view.curve = dag.curve;
  view.root = dag.root;
  view.leaves = dag.leaves.data();
  view.leaf_count = dag.leaves.size();
  for (size_t h = 0; h < dag.nodes.size(); ++h) {
    view.nodes[h] = dag.nodes[h].data();
    view.words[h] = dag.nodes[h].size();
  }
  return view;
}

/// The number, among the colours of a leaf word with Colors::all, of that of the cell of height 0 to 2 around
/// voxel `bit`.
inline uint32_t leaf_cell_index(uint64_t leaf, uint32_t bit, int height, OrderState state) {
  if (height == leaf_height) return 0;
  if (height == 0) return leaf_index(leaf, bit, Colors::all, state);
  const uint32_t octant = bit >> 3;
  const uint32_t first = 8 * octant + octant_orders.octant[octant_orders.next[state][octant]][0];
  const uint64_t before = leaf & octant_orders.voxels_before[state][first];
  return 1 + static_cast<uint32_t>(std::popcount(before)) + count_octants(leaf_octants(before));
}

/// Whether there is a voxel in the cell of some height, 0 for the voxel itself, around a place, a Morton code
/// inside the grid, and if so which colour the cell has. Above 0 only with Colors::all.
struct Found {
  bool there = false;
  uint64_t color = 0;
};

/// Finds cells one after the other: keeps the way to the last one, most of which is that to its neighbours.
class CellFinder {
 public:
  explicit CellFinder(const DagView& view) : view_(view), lowest_(view.height) {
    path_[static_cast<size_t>(view.height)] = {view.root, first_state(view.curve), 0};
  }

  Found find(uint64_t place, int height) {
    // Nodes of this height and above are those of the last place.
    const int common = (static_cast<int>(std::bit_width(place ^ place_)) + 2) / 3;
    place_ = place;
    for (int h = std::max({lowest_, common, height}); h > leaf_height; --h) {
      lowest_ = h;
      const Step at = path_[static_cast<size_t>(h)];
      const auto octant = static_cast<uint32_t>(place >> 3 * (h - 1) & 7);
      const NodeRef node = view_.node(h, at.pointer);
      if (!node.there) return {};
      if (h == height) return {true, at.color};
      if (!node.has(octant)) return {};
      const ChildRef child = view_.child(node, h, octant, at.state);
      path_[static_cast<size_t>(h) - 1] = {child.pointer, octant_orders.next[at.state][octant],
                                           at.color + child.colors_before};
    }
    lowest_ = leaf_height;
    const Step at = path_[leaf_height];
    const auto bit = static_cast<uint32_t>(place & 63);
    const uint64_t leaf = view_.leaf(at.pointer);
    const int shift = 3 * height, width = 1 << shift;
    const uint64_t cell =
        height >= leaf_height ? leaf : leaf >> (bit >> shift << shift) & ((uint64_t{1} << width) - 1);
    if (cell == 0) return {};
    return {true, at.color + (height == 0 ? leaf_index(leaf, bit, view_.colors, at.state)
                                          : leaf_cell_index(leaf, bit, height, at.state))};
  }

 private:
  struct Step {
    uint32_t pointer;
    OrderState state;
    uint64_t color;  ///< the first one of the node
  };
  const DagView& view_;
  std::array<Step, most_levels + 1> path_;  ///< by height, down to `lowest_`
  uint64_t place_ = 0;
  int lowest_;
};

inline Found find_cell(const DagView& view, uint64_t place, int height) {
  return CellFinder(view).find(place, height);
}
inline Found find_voxel(const DagView& view, uint64_t place) {
  return find_cell(view, place, 0);
}

}  // namespace voxkit::color
