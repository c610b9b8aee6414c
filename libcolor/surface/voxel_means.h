// Many colours at a place become one: their mean in linear light.
#pragma once

#include <algorithm>
#include <vector>

#include "libcolor/surface/linear_light.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// Hands voxels to a sink, in runs: one for each place that comes, with the mean of its colours in linear
/// light, rounded once. Places ascend, and those that are equal come one after the other, fewer than 2^46.
class VoxelMeans {
 public:
  explicit VoxelMeans(const SurfaceSource::Sink& sink) : sink_(sink), tables_(light_tables()) {
    run_.reserve(run_voxels);
  }
  Status add(const SurfaceVoxel& point) {
    if (count_ > 0 && point.place != place_) VOX_CHECK(put());
    place_ = point.place;
    sum_[0] += tables_.linear[point.color.r];
    sum_[1] += tables_.linear[point.color.g];
    sum_[2] += tables_.linear[point.color.b];
    ++count_;
    return {};
  }
  Status finish() {
    if (count_ > 0) VOX_CHECK(put());
    return run_.empty() ? Status() : sink_(run_);
  }

 private:
  static constexpr size_t run_voxels = 1 << 14;
  Status put() {
    const auto mean = [&](uint64_t light) { return tables_.stored[(2 * light + count_) / (2 * count_)]; };
    run_.push_back({place_, {mean(sum_[0]), mean(sum_[1]), mean(sum_[2])}});
    std::fill_n(sum_, 3, 0);
    count_ = 0;
    if (run_.size() < run_voxels) return {};
    VOX_CHECK(check_interrupt());
    VOX_CHECK(sink_(run_));
    run_.clear();
    return {};
  }

  const SurfaceSource::Sink& sink_;
  const LightTables& tables_;
  std::vector<SurfaceVoxel> run_;
  uint64_t place_ = 0, sum_[3] = {}, count_ = 0;
};

}  // namespace voxkit::color
