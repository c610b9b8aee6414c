// Quantisation of colours, first step: a set of them cut into parts.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// A colour and how often it comes, 1 or more.
struct WeightedColor {
  Rgb color;
  uint32_t weight = 0;
};

/// Sums over colours.
struct ColorSums {
  uint64_t weight = 0, r = 0, g = 0, b = 0;
  void add(const WeightedColor& c) {
    weight += c.weight;
    r += uint64_t{c.weight} * c.color.r;
    g += uint64_t{c.weight} * c.color.g;
    b += uint64_t{c.weight} * c.color.b;
  }
  /// Of at least one colour: the mean, rounded.
  Rgb mean() const {
    const auto part = [&](uint64_t sum) { return static_cast<uint8_t>((2 * sum + weight) / (2 * weight)); };
    return {part(r), part(g), part(b)};
  }
};

/// Cuts a set of different colours into `parts` parts at most, one after another by a plane of one value of
/// R, G or B: always where that lessens the sum of squared distances to the means most (X. Wu, "Color
/// quantization by dynamic programming and principal analysis", TOG 1992, without its table of moments, so
/// that colours keep all their bits). Puts the colours in the order of the parts; returns where each begins.
std::vector<uint32_t> split_colors(std::span<WeightedColor> colors, uint32_t parts);

}  // namespace voxkit::color
