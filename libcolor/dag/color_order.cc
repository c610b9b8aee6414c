#include "libcolor/dag/color_order.h"

#include <bit>

#include "libcolor/dag/dag_view.h"
#include "libcolor/surface/linear_light.h"

namespace voxkit::color {
namespace {

/// Linear light of some voxels.
struct Light {
  uint64_t r = 0, g = 0, b = 0, voxels = 0;
  Light& operator+=(const Light& other) {
    r += other.r;
    g += other.g;
    b += other.b;
    voxels += other.voxels;
    return *this;
  }
};

class Walk {
 public:
  Walk(const Dag& dag, bool all, std::span<const Rgb> voxels, std::vector<Rgb>& colors)
      : view_(view_of(dag)), all_(all), tables_(light_tables()), voxels_(voxels), colors_(colors) {}

  /// A node, and the number of its first voxel in Morton order.
  Light node(int h, uint32_t pointer, OrderState state, uint64_t first) {
    if (h == leaf_height) return word(view_.leaf(pointer), state, first);
    const size_t own = begin();
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
    Light sum;
    for (const uint8_t octant : octant_orders.octant[state])
      if (ref.has(octant))
        sum +=
            node(h - 1, children[octant].pointer, octant_orders.next[state][octant], children[octant].first);
    return end(own, sum);
  }

 private:
  Light word(uint64_t leaf, OrderState state, uint64_t first) {
    const size_t own = begin();
    Light sum;
    for (const uint8_t octant : octant_orders.octant[state]) {
      if ((leaf >> 8 * octant & 0xff) == 0) continue;
      const size_t own_octant = begin();
      Light below;
      for (const uint8_t voxel : octant_orders.octant[octant_orders.next[state][octant]]) {
        const uint64_t bit = uint64_t{1} << (8 * octant + voxel);
        if ((leaf & bit) == 0) continue;
        const Rgb color = voxels_[first + static_cast<uint64_t>(std::popcount(leaf & (bit - 1)))];
        colors_.push_back(color);
        below += {tables_.linear[color.r], tables_.linear[color.g], tables_.linear[color.b], 1};
      }
      sum += end(own_octant, below);
    }
    return end(own, sum);
  }
  /// Room for the colour of a cell, before those below it.
  size_t begin() {
    if (all_) colors_.emplace_back();
    return colors_.size() - 1;
  }
  Light end(size_t own, const Light& sum) {
    if (!all_) return sum;
    const auto mean = [&](uint64_t light) {
      return tables_.stored[(2 * light + sum.voxels) / (2 * sum.voxels)];
    };
    colors_[own] = {mean(sum.r), mean(sum.g), mean(sum.b)};
    return sum;
  }

  const DagView view_;
  const bool all_;
  const LightTables& tables_;
  std::span<const Rgb> voxels_;
  std::vector<Rgb>& colors_;
};

}  // namespace

Result<std::vector<Rgb>> colors_in_order(const Dag& dag, uint64_t count, Colors colors, Curve curve,
                                         std::span<const Rgb> voxels, Reservation& memory) {
  std::vector<Rgb> ordered;
  if (voxels.empty()) return ordered;
  VOX_CHECK(memory.add(count * sizeof(Rgb), "room for colors in order"));
  ordered.reserve(count);
  Walk(dag, colors == Colors::all, voxels, ordered).node(dag.height, dag.root, first_state(curve), 0);
  return ordered;
}

}  // namespace voxkit::color
