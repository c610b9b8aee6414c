// The lattice that residuals of colours are on: a body-centred cubic one, of which a ball holds about half
// as many points as of a cubic one that is nowhere further away (J. Conway, N. Sloane, Sphere packings,
// lattices and groups, 1988). File: formats/FORMAT.md, section 4.12.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// Of R, G, B.
using Channels = std::array<int32_t, 3>;

/// A point is steps[c] * k[c] for whole numbers k that are all even or all odd; no steps: all points.
struct ColorSteps {
  std::array<uint8_t, 3> steps{};

  bool lossless() const { return steps[1] == 0; }
  /// What is as large as contrasts are to be.
  int32_t unit() const { return lossless() ? 2 : steps[1]; }

  /// A point, as what it is coded as: G, and how far R and B are from it.
  Channels coded(const Channels& k) const {
    const int32_t divisor = lossless() ? 1 : 2;
    return {k[1], (k[0] - k[1]) / divisor, (k[2] - k[1]) / divisor};
  }
  Channels point(const Channels& coded) const {
    const int32_t factor = lossless() ? 1 : 2;
    return {coded[0] + factor * coded[1], coded[0], coded[0] + factor * coded[2]};
  }
  /// The colour at a point from a predicted one, within what a colour can be.
  Rgb color(const Channels& predicted, const Channels& k) const {
    const auto channel = [&](size_t c) {
      const int32_t step = lossless() ? 1 : steps[c];
      return static_cast<uint8_t>(std::clamp(predicted[c] + step * k[c], 0, 255));
    };
    return {channel(0), channel(1), channel(2)};
  }
};

/// The square of the greatest distance that a threshold allows, of colours.
uint32_t most_squared(double threshold);
/// The largest steps with which a point is so near to every colour.
ColorSteps steps_for(double threshold);

}  // namespace voxkit::color
