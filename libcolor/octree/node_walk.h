// Going through the nodes of a page of an octree, each with the nodes around it.
#pragma once

#include <array>
#include <cstdint>

#include "libcolor/octree/octree.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

inline constexpr uint32_t no_node = ~uint32_t{0};
/// The numbers of the nodes around one, and its own, [x + 1 + 3 (y + 1) + 9 (z + 1)] for x, y, z from -1 to
/// 1: `no_node` where there is nothing.
using Neighbors = std::array<uint32_t, 27>;
inline constexpr size_t center = 13;

/// For each octant and each direction: which of its parent's neighbours has the neighbour, and in which
/// octant.
struct NeighborPlaces {
  struct Place {
    uint8_t parent, octant;
  };
  std::array<std::array<Place, 27>, 8> of{};
};
inline constexpr NeighborPlaces neighbor_places = [] {
  NeighborPlaces places;
  for (int octant = 0; octant < 8; ++octant)
    for (int d = 0; d < 27; ++d) {
      int parent = 0, at = 0, weight = 1;
      for (int a = 0, rest = d; a < 3; ++a, rest /= 3, weight *= 3) {
        const int child = (octant >> a & 1) + rest % 3 - 1;  // -1 to 2, from the parent's corner on
        parent += (child < 0 ? 0 : child < 2 ? 1 : 2) * weight;
        at |= (child & 1) << a;
      }
      places.of[static_cast<size_t>(octant)][static_cast<size_t>(d)] = {static_cast<uint8_t>(parent),
                                                                        static_cast<uint8_t>(at)};
    }
  return places;
}();

/// Goes through the nodes of one page, one after the other.
class NodeWalk {
 public:
  /// Begins with the page's first node. The pages above it that it needs become ready.
  NodeWalk(const Octree& octree, int height, uint64_t page) : octree_(octree), height_(height) {
    // The way up from the page's first node, and down again.
    std::array<uint8_t, most_levels + 1> octants{};
    uint64_t node = page << page_nodes_log2;
    for (int h = height + 1; h <= octree.height(); ++h) {
      const auto [parent, octant] = parent_of(h, node);
      octants[static_cast<size_t>(h)] = octant;
      node = parent;
    }
    Neighbors& root = at(octree.height()).neighbors;
    root.fill(no_node);
    root[center] = 0;
    if (octree.height() > height) open(octree.height());
    for (int h = octree.height(); h > height; --h) enter(h, octants[static_cast<size_t>(h)]);
  }

  /// The neighbours of the node that the walk is at. Where a page above is damaged, the center is another
  /// node than it should be.
  const Neighbors& neighbors() const { return steps_[static_cast<size_t>(height_)].neighbors; }
  /// Goes on to the next node of the height, if there is one.
  bool next() {
    int h = height_ + 1;
    while (h <= octree_.height() && at(h).left == 0) ++h;
    if (h > octree_.height()) return false;
    for (; h > height_; --h) {
      if (at(h).left == 0) return false;
      enter(h, static_cast<uint32_t>(std::countr_zero(at(h).left)));
    }
    return true;
  }

 private:
  /// A node on the way, of which the walk is in some octant.
  struct Step {
    Neighbors neighbors;
    std::array<uint32_t, 27> first_child;
    std::array<uint8_t, 27> masks;
    uint32_t left = 0;  ///< octants that are still to come, as a mask
  };

  struct Parent {
    uint64_t node;
    uint8_t octant;
  };
  /// The node of a height that has a child with this number.
  Parent parent_of(int h, uint64_t child) const {
    const uint64_t page = octree_.level(h).page_with_child(child);
    uint64_t low = page << page_nodes_log2;
    const OctreeLevel& level = octree_.level_at(h, low);
    uint64_t high = low + nodes_of_page(level.nodes(), page);
    while (high - low > 1) {  // the last node whose first child is not behind it
      const uint64_t middle = (low + high) / 2;
      (level.first_child(middle) <= child ? low : high) = middle;
    }
    uint32_t mask = level.mask(low);
    for (uint64_t before = child - level.first_child(low); before > 0 && mask != 0; --before)
      mask &= mask - 1;
    return {low, static_cast<uint8_t>(mask == 0 ? 0 : std::countr_zero(mask))};
  }

  Step& at(int h) { return steps_[static_cast<size_t>(h)]; }
  /// Looks up the masks around a node of a height.
  void open(int h) {
    Step& step = at(h);
    for (size_t i = 0; i < step.neighbors.size(); ++i) {
      const uint32_t node = step.neighbors[i];
      step.masks[i] = 0;
      if (node == no_node) continue;
      const OctreeLevel& level = octree_.level_at(h, node);
      step.masks[i] = level.mask(node);
      step.first_child[i] = static_cast<uint32_t>(level.first_child(node));
    }
    step.left = step.masks[center];
  }
  /// From a node of a height into its octant.
  void enter(int h, uint32_t octant) {
    Step& step = at(h);
    step.left &= ~((2u << octant) - 1);
    Step& below = at(h - 1);
    const auto& places = neighbor_places.of[octant];
    for (size_t i = 0; i < places.size(); ++i) {
      const auto [parent, place] = places[i];
      const uint32_t mask = step.masks[parent];
      below.neighbors[i] = (mask >> place & 1) != 0
                               ? step.first_child[parent] + count_octants(mask & ((1u << place) - 1))
                               : no_node;
    }
    if (h - 1 > height_) open(h - 1);
  }

  const Octree& octree_;
  int height_;
  std::array<Step, most_levels + 1> steps_;  ///< by height
};

}  // namespace voxkit::color
