// The values that coarser levels may have, where those of the volume are far apart.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace voxkit::svmm {

/// Of a volume whose values keep a distance of each other, as those of measurements of few bits do, means
/// need be no finer: what they are rounded to. A mean moves by at most about half the least distance of two
/// values, and at most a 64th of their range.
class Raster {
 public:
  /// Everything stays as it is.
  Raster() = default;
  /// From all values of a volume, ascending, of up to 16 bits: these, and as many more between two of them as
  /// it takes to be as near to each other as the nearest two are, or as a 32nd of the range.
  explicit Raster(std::span<const uint32_t> values);
  bool empty() const { return values_.empty(); }
  /// About how far they are apart, at least; 0 of an empty one.
  uint32_t step() const { return step_; }
  /// Ascending.
  const std::vector<uint32_t>& values() const { return values_; }
  /// The nearest of these, the lower one of two. `value` within the range of those that it is made from.
  uint32_t operator()(uint32_t value) const { return nearest_[value]; }

 private:
  uint32_t step_ = 0;
  std::vector<uint32_t> values_;
  std::vector<uint16_t> nearest_;
};

}  // namespace voxkit::svmm
