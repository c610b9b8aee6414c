#include "librender/dvr/transfer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "librender/cast/opacity.h"

namespace voxkit::render {
namespace {

struct Preset {
  const char* name;
  std::vector<TransferPoint> points;  ///< values 0..1: over the range
};
const std::vector<Preset>& presets() {
  static const std::vector<Preset> all = {
      {"gray", {{0, {0, 0, 0, 0}}, {1, {1, 1, 1, 0.5}}}},
      // Of a CT scan whose range is air to the densest bone.
      {"ct-bone",
       {{0.30, {0.80, 0.62, 0.45, 0}},
        {0.36, {0.86, 0.74, 0.58, 0.30}},
        {0.50, {0.95, 0.91, 0.82, 0.80}},
        {1, {1, 1, 0.97, 0.95}}}},
      {"ct-skin",
       {{0.08, {0.75, 0.45, 0.35, 0}},
        {0.16, {0.90, 0.65, 0.52, 0.10}},
        {0.24, {0.90, 0.62, 0.50, 0.06}},
        {0.30, {0.80, 0.62, 0.45, 0.02}},
        {0.36, {0.86, 0.74, 0.58, 0.30}},
        {0.50, {0.95, 0.91, 0.82, 0.80}},
        {1, {1, 1, 0.97, 0.95}}}},
      {"hot",
       {{0.10, {0.10, 0, 0, 0}},
        {0.40, {0.85, 0.10, 0.02, 0.05}},
        {0.70, {1, 0.65, 0.05, 0.25}},
        {1, {1, 1, 0.85, 0.60}}}},
      // Half opaque within a few steps of the middle of the range.
      {"surface", {{0.48, {0.9, 0.85, 0.75, 0}}, {0.52, {0.9, 0.85, 0.75, 0.9}}}},
  };
  return all;
}

/// -log2(1 - opacity).
float density_of(double opacity) {
  if (!(opacity > 0)) return 0;
  // Above 0.9999999 all but nothing is let through.
  const double least = 1 - std::min(opacity, 1 - 0x1p-40);
  const double density = least >= 1 ? 0 : -log2_of_fraction(least);
  if (opacity >= 1) return TransferFunction::opaque_density;
  return std::max(static_cast<float>(density), 1e-20f);
}

}  // namespace

TransferFunction::TransferFunction(std::vector<TransferPoint> points)
    : points_(std::move(points)), table_(entries), seen_(entries + 1) {
  const double first = points_.front().value, last = points_.back().value;
  // At least what the rounding of floats leaves of it, and a scale that is a number.
  const double magnitude = std::max(std::abs(first), std::abs(last));
  const double width = std::max({last - first, magnitude > 0 ? magnitude * 1e-6 : 1e-6, 1e-34});
  // Beyond the first and the last point the table has half a step of each.
  constexpr double most = std::numeric_limits<float>::max();
  first_ = static_cast<float>(std::clamp(first - width * (0.5 / (entries - 1)), -most, most));
  scale_ = static_cast<float>((entries - 1) / width);
  span_ = static_cast<float>(std::min(width, most));
  for (int i = 0; i < entries; ++i) {
    const auto rgba = (*this)(first + width * i / (entries - 1));
    Entry& entry = table_[static_cast<size_t>(i)];
    for (size_t k = 0; k < 3; ++k) entry.rgb[k] = static_cast<float>(rgba[k]);
    entry.density = density_of(rgba[3]);
    seen_[static_cast<size_t>(i + 1)] = seen_[static_cast<size_t>(i)] + (entry.density > 0);
  }
}

std::array<double, 4> TransferFunction::operator()(double value) const {
  if (!(value > points_.front().value)) return points_.front().rgba;
  if (value >= points_.back().value) return points_.back().rgba;
  const auto after = std::upper_bound(points_.begin(), points_.end(), value,
                                      [](double v, const TransferPoint& p) { return v < p.value; });
  const TransferPoint &a = *(after - 1), &b = *after;
  const double share = (value - a.value) / (b.value - a.value);
  std::array<double, 4> rgba;
  for (size_t k = 0; k < 4; ++k) rgba[k] = a.rgba[k] + share * (b.rgba[k] - a.rgba[k]);
  return rgba;
}

int TransferFunction::entry_of(float value) const {
  const float x = (value - first_) * scale_;
  return x > 0 ? (x < entries - 1 ? static_cast<int>(x) : entries - 1) : 0;
}

bool TransferFunction::shows(float lo, float hi) const {
  if (!(lo <= hi)) return false;
  // Interpolating rounds a few times, each by less than 2^-23 of the largest value.
  const float slack = std::max(std::abs(lo), std::abs(hi)) * 0x1p-20f;
  const int from = entry_of(lo - slack), to = entry_of(hi + slack);
  return seen_[static_cast<size_t>(to + 1)] > seen_[static_cast<size_t>(from)];
}

std::string transfer_presets() {
  std::string names;
  for (const Preset& preset : presets()) names += (names.empty() ? "" : ", ") + std::string(preset.name);
  return names;
}

bool is_transfer_preset(const std::string& name) {
  return std::any_of(presets().begin(), presets().end(), [&](const Preset& p) { return p.name == name; });
}

std::optional<TransferFunction> transfer_preset(const std::string& name, const ValueRange& range) {
  for (const Preset& preset : presets()) {
    if (preset.name != name) continue;
    std::vector<TransferPoint> points = preset.points;
    for (TransferPoint& point : points) point.value = range.lo + (range.hi - range.lo) * point.value;
    return TransferFunction(std::move(points));
  }
  return std::nullopt;
}

}  // namespace voxkit::render
