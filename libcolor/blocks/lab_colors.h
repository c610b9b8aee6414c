// CIELAB of stored colours, fast, for the loops that fit blocks.
#pragma once

#include <array>
#include <vector>

#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// L*, a* and b*, each times `lab_scale`.
using LabPoint = std::array<float, 3>;
inline constexpr int lab_scale = 64;

/// Two points are as far apart as delta_e() says, within this.
inline constexpr double lab_precision = 1.0 / 1024;

/// From a table of the light of stored values, and one of the curve of formats/lab.h, between whose entries
/// it goes in straight lines. The same on every machine.
class LabColors {
 public:
  LabColors();
  LabPoint point(Rgb color) const {
    const double r = light_[color.r], g = light_[color.g], b = light_[color.b];
    const double x = curve(shares_[0], r, g, b), y = curve(shares_[1], r, g, b),
                 z = curve(shares_[2], r, g, b);
    return {static_cast<float>(lab_scale * (116 * y - 16)), static_cast<float>(lab_scale * 500 * (x - y)),
            static_cast<float>(lab_scale * 200 * (y - z))};
  }

 private:
  static constexpr int steps = 1 << 14;
  double curve(const std::array<double, 3>& share, double r, double g, double b) const {
    const double at = share[0] * r + share[1] * g + share[2] * b;
    const auto step = static_cast<size_t>(at);
    return curve_[step] + (at - static_cast<double>(step)) * (curve_[step + 1] - curve_[step]);
  }

  std::array<double, 256> light_;
  std::array<std::array<double, 3>, 3> shares_;  ///< times `steps`
  std::vector<double> curve_;
};
const LabColors& lab_colors();

}  // namespace voxkit::color
