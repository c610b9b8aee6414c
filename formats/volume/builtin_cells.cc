// A segmentation: the cells of points strewn over a cube, each with a number of its own.
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <glm/common.hpp>
#include <limits>
#include <vector>

#include "formats/hash.h"
#include "formats/volume/builtin.h"

namespace voxkit {
namespace {

class CellsSource final : public VolumeSource {
 public:
  CellsSource(int64_t side, int64_t count) {
    info_.dims = Index3(side);
    info_.format = count <= 256 ? VoxelFormat::density8 : VoxelFormat::density16;
    info_.sample_type = SampleType::u32;
    info_.is_labels = true;
    struct Named {
      uint32_t name;
      Index3 point;
    };
    std::vector<Named> cells;
    for (int64_t i = 0; i < count; ++i) {
      const auto at = [&](uint64_t axis) {
        return static_cast<int64_t>(random64(axis, static_cast<uint64_t>(i)) % static_cast<uint64_t>(side));
      };
      // Names are as far apart as those of real segmentations; an odd factor leaves all different.
      cells.push_back({static_cast<uint32_t>(i + 1) * 2654435761u, {at(0), at(1), at(2)}});
    }
    std::ranges::sort(cells, {}, &Named::name);
    auto names = std::make_shared<std::vector<int64_t>>();
    for (const Named& cell : cells) {
      names->push_back(cell.name);
      points_.push_back(cell.point);
    }
    info_.labels = std::move(names);
  }

  Status read(const Box& box, VoxelSpan out) override {
    std::vector<uint16_t> near;
    const Index3 first = box.lo / block, last = (box.hi + (block - 1)) / block;
    for (int64_t z = first.z; z < last.z; ++z)
      for (int64_t y = first.y; y < last.y; ++y)
        for (int64_t x = first.x; x < last.x; ++x) {
          const Index3 lo = Index3(x, y, z) * block;
          const Box part = intersect({lo, lo + block}, box);
          find_near({lo, lo + block}, near);
          for (int64_t k = part.lo.z; k < part.hi.z; ++k)
            for (int64_t j = part.lo.y; j < part.hi.y; ++j) {
              std::byte* const row = out.row(j - box.lo.y, k - box.lo.z);
              for (int64_t i = part.lo.x; i < part.hi.x; ++i) {
                const uint16_t cell = nearest({i, j, k}, near);
                const int64_t bytes = voxel_bytes(info_.format);
                std::memcpy(row + (i - box.lo.x) * bytes, &cell, static_cast<size_t>(bytes));
              }
            }
        }
    return {};
  }

 private:
  static constexpr int64_t block = 8;

  static int64_t square(Index3 d) { return d.x * d.x + d.y * d.y + d.z * d.z; }
  /// All cells that a voxel of the box may be in, in their order.
  void find_near(const Box& box, std::vector<uint16_t>& near) const {
    const auto furthest = [&](Index3 p) {
      return square(glm::max(glm::abs(p - box.lo), glm::abs(p - (box.hi - int64_t{1}))));
    };
    const auto closest = [&](Index3 p) { return square(p - glm::clamp(p, box.lo, box.hi - int64_t{1})); };
    int64_t within = std::numeric_limits<int64_t>::max();
    for (const Index3& p : points_) within = std::min(within, furthest(p));
    near.clear();
    for (size_t i = 0; i < points_.size(); ++i)
      if (closest(points_[i]) <= within) near.push_back(static_cast<uint16_t>(i));
  }
  /// The first of equally near ones.
  uint16_t nearest(Index3 voxel, const std::vector<uint16_t>& near) const {
    uint16_t best = 0;
    int64_t least = std::numeric_limits<int64_t>::max();
    for (const uint16_t i : near)
      if (const int64_t d = square(voxel - points_[i]); d < least) {
        least = d;
        best = i;
      }
    return best;
  }

  std::vector<Index3> points_;  ///< by stored value
};

}  // namespace

std::unique_ptr<VolumeSource> cells_source(int64_t side, int64_t count) {
  return std::make_unique<CellsSource>(side, count);
}

}  // namespace voxkit
