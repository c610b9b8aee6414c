// Asking whether a box of a surface is void, without a look at what one answer settles.
#pragma once

#include <array>
#include <bit>

#include "libcolor/dag/dag_view.h"
#include "libcolor/surface/morton.h"

namespace voxkit::color {

/// For each axis, the bits of a leaf word whose voxels are at from <= place < to along it.
using LeafSlabs = std::array<std::array<std::array<uint64_t, 5>, 5>, 3>;  ///< [axis][from][to]
constexpr LeafSlabs make_leaf_slabs() {
  LeafSlabs slabs{};
  for (size_t axis = 0; axis < 3; ++axis)
    for (uint32_t from = 0; from < 5; ++from)
      for (uint32_t to = from; to < 5; ++to)
        for (uint32_t bit = 0; bit < 64; ++bit) {
          const uint32_t place = (bit >> axis & 1) | (bit >> (axis + 3) & 1) << 1;
          if (place >= from && place < to) slabs[axis][from][to] |= uint64_t{1} << bit;
        }
  return slabs;
}
inline constexpr LeafSlabs leaf_slabs = make_leaf_slabs();

/// Whether no voxel is at lo <= v < hi, a box that is not empty. Enters `budget` nodes and words at most,
/// which it counts down; false where these do not suffice or a node is missing.
class VoidSearch {
 public:
  VoidSearch(const DagView& view, int budget) : view_(view), budget_(budget) {}

  bool operator()(const uint32_t (&lo)[3], const uint32_t (&hi)[3]) {
    found_ = false;
    for (int a = 0; a < 3; ++a) lo_[a] = lo[a], hi_[a] = hi[a];
    return is_void(view_.height, view_.root, {0, 0, 0});
  }
  int budget() const { return budget_; }
  /// Of a box that is not void: whether that is since a voxel was found, and where along an axis it lies,
  /// begin <= v < end.
  bool found() const { return found_; }
  uint64_t begin(int axis) const { return at_[static_cast<size_t>(axis)]; }
  uint64_t end(int axis) const { return begin(axis) + 1; }

 private:
  using Corner = std::array<uint32_t, 3>;

  bool is_void(int h, uint32_t pointer, const Corner& corner) {
    if (--budget_ < 0) return false;
    if (h == leaf_height) return is_void_leaf(view_.leaf(pointer), corner);
    const NodeRef node = view_.node(h, pointer);
    if (!node.there) return false;
    // Octants that the box reaches into, as a mask.
    constexpr uint32_t upper[3] = {0xaa, 0xcc, 0xf0};
    uint32_t octants = node.mask;
    const uint32_t half = 1u << (h - 1);
    for (size_t a = 0; a < 3; ++a) {
      const uint32_t middle = corner[a] + half;
      if (lo_[a] >= middle) octants &= upper[a];
      if (hi_[a] <= middle) octants &= ~upper[a];
    }
    for (; octants != 0; octants &= octants - 1) {
      const auto octant = static_cast<uint32_t>(std::countr_zero(octants));
      Corner at = corner;
      for (size_t a = 0; a < 3; ++a) at[a] += (octant >> a & 1) * half;
      if (!is_void(h - 1, view_.pointer(node, octant), at)) return false;
    }
    return true;
  }

  bool is_void_leaf(uint64_t leaf, const Corner& corner) {
    for (size_t a = 0; a < 3; ++a) {
      const uint32_t from = lo_[a] > corner[a] ? lo_[a] - corner[a] : 0,
                     to = hi_[a] - corner[a] < 4 ? hi_[a] - corner[a] : 4;
      leaf &= leaf_slabs[a][from][to];
    }
    if (leaf == 0) return true;
    const glm::uvec3 place = morton_place(static_cast<uint64_t>(std::countr_zero(leaf)));
    at_ = {corner[0] + place.x, corner[1] + place.y, corner[2] + place.z};
    found_ = true;
    return false;
  }

  const DagView& view_;
  int budget_;
  uint32_t lo_[3] = {}, hi_[3] = {};
  bool found_ = false;
  Corner at_{};
};

}  // namespace voxkit::color
