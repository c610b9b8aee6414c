#include "libcolor/dag/color_order.h"

#include "libcolor/dag/cell_order.h"
#include "libcolor/surface/linear_light.h"

namespace voxkit::color {
namespace {

/// Linear light of some voxels.
struct Light {
  uint64_t r = 0, g = 0, b = 0, voxels = 0;
  void add(const Light& other) {
    r += other.r;
    g += other.g;
    b += other.b;
    voxels += other.voxels;
  }
};

class ColorsOut {
 public:
  using Sums = Light;
  ColorsOut(bool all, std::span<const Rgb> voxels, std::vector<Rgb>& colors)
      : all_(all), tables_(light_tables()), voxels_(voxels), colors_(colors) {}

  Light voxel(uint64_t first) {
    const Rgb color = voxels_[first];
    colors_.push_back(color);
    return {tables_.linear[color.r], tables_.linear[color.g], tables_.linear[color.b], 1};
  }
  size_t begin() {
    if (all_) colors_.emplace_back();
    return colors_.size() - 1;
  }
  void end(size_t room, int, const Light& sum) {
    if (!all_) return;
    const auto mean = [&](uint64_t light) {
      return tables_.stored[(2 * light + sum.voxels) / (2 * sum.voxels)];
    };
    colors_[room] = {mean(sum.r), mean(sum.g), mean(sum.b)};
  }

 private:
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
  ColorsOut out(colors == Colors::all, voxels, ordered);
  CellOrder(dag, out).run(curve);
  return ordered;
}

}  // namespace voxkit::color
