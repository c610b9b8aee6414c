// Many points at a place, with attributes, become one voxel.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "formats/mesh/point_cloud.h"
#include "libcolor/surface/heaviest.h"
#include "libcolor/surface/linear_light.h"
#include "libcolor/surface/octahedral.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// A point in the grid with what it has beside its colour.
struct AttributedPoint {
  uint64_t place = 0;
  Rgb color;
  uint8_t alpha = 255;
  std::array<int16_t, 3> normal{};  ///< of length 2^14, or 0
  uint8_t roughness = 255, metalness = 0;
  Rgb emission;
  uint32_t label = 0;

  AttributedPoint() = default;
  AttributedPoint(uint64_t p, const CloudPoint& from, bool opacity)
      : place(p),
        color{from.color[0], from.color[1], from.color[2]},
        alpha(opacity ? from.alpha : uint8_t{255}),
        roughness(from.roughness),
        metalness(from.metalness),
        emission{from.emission[0], from.emission[1], from.emission[2]},
        label(from.label) {
    const double x = from.normal.x, y = from.normal.y, z = from.normal.z;
    const double length = std::sqrt(x * x + y * y + z * z);
    if (!(length > 0) || !std::isfinite(length)) return;
    const auto part = [&](double v) { return static_cast<int16_t>(std::lround(v / length * (1 << 14))); };
    normal = {part(x), part(y), part(z)};
  }
};

/// As VoxelMeans: what a voxel has is the mean of what its points have, each by its opacity; its own opacity
/// is the mean of theirs, and 255 where one has that; its id is the label that most of its points have, the
/// lowest of several.
class PointMeans {
 public:
  PointMeans(const SurfaceSource::Sink& sink, AttributeSet attributes)
      : sink_(sink), attributes_(attributes), tables_(light_tables()) {
    voxels_.reserve(run_voxels);
    bytes_.reserve(run_voxels * attributes.bytes());
  }
  Status add(const AttributedPoint& point) {
    if (count_ > 0 && point.place != place_) VOX_CHECK(put());
    place_ = point.place;
    const uint64_t weight = point.alpha;
    light_[0] += weight * tables_.linear[point.color.r];
    light_[1] += weight * tables_.linear[point.color.g];
    light_[2] += weight * tables_.linear[point.color.b];
    for (size_t c = 0; c < 3; ++c) normal_[c] += static_cast<int64_t>(weight) * point.normal[c];
    rm_[0] += weight * point.roughness;
    rm_[1] += weight * point.metalness;
    glow_[0] += weight * tables_.linear[point.emission.r];
    glow_[1] += weight * tables_.linear[point.emission.g];
    glow_[2] += weight * tables_.linear[point.emission.b];
    weight_ += weight;
    most_ = std::max(most_, point.alpha);
    ++count_;
    if (!attributes_.has(Attribute::id)) return {};
    if (labels_.empty() || labels_.back().first != point.label) labels_.emplace_back(point.label, 0);
    ++labels_.back().second;
    return {};
  }
  Status finish() {
    if (count_ > 0) VOX_CHECK(put());
    return voxels_.empty() ? Status() : sink_({voxels_, bytes_});
  }

 private:
  static constexpr size_t run_voxels = 1 << 14;

  Status put() {
    const auto mean = [&](uint64_t sum) { return (2 * sum + weight_) / (2 * weight_); };
    const auto stored = [&](uint64_t light) { return tables_.stored[mean(light)]; };
    voxels_.push_back({place_, {stored(light_[0]), stored(light_[1]), stored(light_[2])}});
    const auto byte = [&](uint64_t value) { bytes_.push_back(static_cast<std::byte>(value)); };
    if (attributes_.has(Attribute::emissive))
      for (const uint64_t light : glow_) byte(stored(light));
    if (attributes_.has(Attribute::opacity)) byte(most_ == 255 ? 255 : (2 * weight_ + count_) / (2 * count_));
    if (attributes_.has(Attribute::normal)) {
      const Octahedral o = octahedral_of(static_cast<double>(normal_[0]), static_cast<double>(normal_[1]),
                                         static_cast<double>(normal_[2]));
      byte(o.u), byte(o.v);
    }
    if (attributes_.has(Attribute::rm))
      for (const uint64_t sum : rm_) byte(mean(sum));
    if (attributes_.has(Attribute::id)) {
      const uint32_t label = heaviest(labels_);
      for (int shift = 0; shift < 32; shift += 8) byte(label >> shift & 255);
    }
    light_ = {}, glow_ = {}, rm_ = {}, normal_ = {}, weight_ = count_ = 0, most_ = 0;
    labels_.clear();
    if (voxels_.size() < run_voxels) return {};
    VOX_CHECK(check_interrupt());
    VOX_CHECK(sink_({voxels_, bytes_}));
    voxels_.clear();
    bytes_.clear();
    return {};
  }

  const SurfaceSource::Sink& sink_;
  AttributeSet attributes_;
  const LightTables& tables_;
  std::vector<SurfaceVoxel> voxels_;
  std::vector<std::byte> bytes_;
  uint64_t place_ = 0, weight_ = 0, count_ = 0;
  uint8_t most_ = 0;
  std::array<uint64_t, 3> light_{}, glow_{};
  std::array<uint64_t, 2> rm_{};
  std::array<int64_t, 3> normal_{};
  std::vector<std::pair<uint32_t, uint64_t>> labels_;  ///< and how many points have them, as they come
};

}  // namespace voxkit::color
