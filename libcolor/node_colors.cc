#include "libcolor/node_colors.h"

#include <bit>

#include "libcolor/dag_view.h"
#include "libcolor/linear_light.h"

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
  Walk(const Dag& dag, std::span<const Rgb> voxels, std::vector<Rgb>& colors)
      : view_(view_of(dag)), tables_(light_tables()), voxels_(voxels), colors_(colors) {}

  Light node(int h, uint32_t pointer) {
    if (h == leaf_height) return cell(view_.leaf(pointer), leaf_height);
    const size_t own = begin();
    const NodeRef ref = view_.node(h, pointer);
    Light sum;
    for (uint32_t i = 0; i < static_cast<uint32_t>(std::popcount(ref.mask)); ++i)
      sum += node(h - 1, view_.pointer(ref, i));
    return end(own, sum);
  }

 private:
  /// A cell of a leaf word, whose voxels are the lowest 8^h bits.
  Light cell(uint64_t bits, int h) {
    if (h == 0) {
      const Rgb color = voxels_[next_++];
      colors_.push_back(color);
      return {tables_.linear[color.r], tables_.linear[color.g], tables_.linear[color.b], 1};
    }
    const size_t own = begin();
    Light sum;
    const int width = 1 << 3 * (h - 1);
    for (int octant = 0; octant < 8; ++octant) {
      const uint64_t part = bits >> octant * width & ((uint64_t{1} << width) - 1);
      if (part != 0) sum += cell(part, h - 1);
    }
    return end(own, sum);
  }
  size_t begin() {
    colors_.emplace_back();
    return colors_.size() - 1;
  }
  Light end(size_t own, const Light& sum) {
    const auto mean = [&](uint64_t light) {
      return tables_.stored[(2 * light + sum.voxels) / (2 * sum.voxels)];
    };
    colors_[own] = {mean(sum.r), mean(sum.g), mean(sum.b)};
    return sum;
  }

  const DagView view_;
  const LightTables& tables_;
  std::span<const Rgb> voxels_;
  size_t next_ = 0;
  std::vector<Rgb>& colors_;
};

}  // namespace

Result<std::vector<Rgb>> node_colors(const Dag& dag, std::span<const Rgb> voxels, Reservation& memory) {
  std::vector<Rgb> colors;
  if (voxels.empty()) return colors;
  VOX_CHECK(memory.add(dag.color_count * sizeof(Rgb), "room for the colors of nodes"));
  colors.reserve(dag.color_count);
  Walk(dag, voxels, colors).node(dag.height, dag.root);
  return colors;
}

}  // namespace voxkit::color
