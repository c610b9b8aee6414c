#include "libsvmm/packed/raster.h"

#include <algorithm>

namespace voxkit::svmm {
namespace {

/// Of the range of the values.
constexpr uint32_t least_steps = 32;

}  // namespace

Raster::Raster(std::span<const uint32_t> values) {
  if (values.size() < 2) return;
  uint32_t step = (values.back() - values.front()) / least_steps;
  for (size_t i = 1; i < values.size(); ++i) step = std::min(step, values[i] - values[i - 1]);
  if (step < 2) return;
  step_ = step;
  values_.push_back(values[0]);
  for (size_t i = 1; i < values.size(); ++i) {
    const uint32_t gap = values[i] - values[i - 1], parts = (gap + step / 2) / step;
    for (uint32_t part = 1; part <= parts; ++part) values_.push_back(values[i - 1] + gap * part / parts);
  }
  nearest_.resize(size_t{values_.back()} + 1);
  size_t at = 0;
  for (uint32_t value = 0; value < nearest_.size(); ++value) {
    while (at + 1 < values_.size() && values_[at + 1] <= value) ++at;
    const bool above =
        at + 1 < values_.size() && value > values_[at] && values_[at + 1] - value < value - values_[at];
    nearest_[value] = static_cast<uint16_t>(values_[at + (above ? 1 : 0)]);
  }
}

}  // namespace voxkit::svmm
