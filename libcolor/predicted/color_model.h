// What is known of a colour before it is coded, and the decisions that tell the rest: the same for whoever
// writes, reads or prices them. File: formats/FORMAT.md, section 4.12.
#pragma once

#include <bit>
#include <cstdlib>
#include <span>
#include <vector>

#include "libcolor/predicted/color_steps.h"
#include "libcolor/predicted/mixed_chance.h"
#include "libcolor/predicted/part_voxels.h"

namespace voxkit::color {

/// Magnitudes in 17 classes.
inline constexpr uint32_t magnitude_classes = 17;
constexpr uint32_t magnitude_class(uint32_t v) {
  constexpr std::array<uint16_t, magnitude_classes - 1> most = {0,  1,  2,  3,  4,  6,  8,   11,
                                                                15, 20, 28, 40, 60, 90, 140, 220};
  uint32_t c = 0;
  while (c < most.size() && v > most[c]) ++c;
  return c;
}

/// A voxel before it is coded.
struct Expected {
  Channels color;
  uint32_t bit;       ///< which one of its cell it is
  uint32_t known;     ///< neighbours that were coded before it
  uint32_t faces;     ///< bit a: one of them is before it along axis a
  uint32_t share;     ///< of them that are not as they were predicted: 0: none known; 1: none; to 7: all
  uint32_t contrast;  ///< class of how far they are from `color`
  uint32_t activity;  ///< class of how far they were from what was expected of them
};

/// Colours of a part, as far as they are coded.
struct CodedColors {
  std::vector<Rgb> colors;
  std::vector<uint8_t> residuals;  ///< |r| + |g| + |b| of their points, at most 255
  explicit CodedColors(uint32_t count) : colors(count), residuals(count) {}

  void set(uint32_t number, Rgb color, const Channels& k) {
    colors[number] = color;
    residuals[number] = static_cast<uint8_t>(std::min(std::abs(k[0]) + std::abs(k[1]) + std::abs(k[2]), 255));
  }
};

/// Of the next voxel, whose number is that.
inline Expected expected(const KnownAround& around, uint32_t bit, uint32_t number, const CodedColors& coded,
                         int32_t unit) {
  // By how many axes a place differs along: of faces, edges, corners.
  constexpr std::array<uint8_t, 8> weights = {0, 6, 6, 2, 6, 2, 2, 1};
  Expected e{{}, bit, 0, 0, 0, 0, 0};
  std::array<Rgb, 26> colors;
  std::array<uint8_t, 26> weight;
  uint32_t total = 0, residuals = 0, active = 0;
  std::array<uint32_t, 3> sum{};
  around.for_each(bit, [&](const KnownNeighbor& neighbor) {
    const Rgb color = coded.colors[neighbor.number];
    const uint8_t w = weights[neighbor.axes];
    colors[e.known] = color;
    weight[e.known] = w;
    ++e.known;
    if (w == weights[1]) e.faces |= neighbor.axes;
    total += w;
    sum[0] += uint32_t{w} * color.r;
    sum[1] += uint32_t{w} * color.g;
    sum[2] += uint32_t{w} * color.b;
    residuals += uint32_t{w} * coded.residuals[neighbor.number];
    active += coded.residuals[neighbor.number] != 0;
  });
  if (e.known == 0) {
    const Rgb before = number > 0 ? coded.colors[number - 1] : Rgb{128, 128, 128};
    e.color = {before.r, before.g, before.b};
    return e;
  }
  for (size_t c = 0; c < 3; ++c) e.color[c] = static_cast<int32_t>((sum[c] + total / 2) / total);
  uint32_t contrast = 0;
  for (uint32_t i = 0; i < e.known; ++i)
    contrast += weight[i] * static_cast<uint32_t>(std::abs(colors[i].r - e.color[0]) +
                                                  std::abs(colors[i].g - e.color[1]) +
                                                  std::abs(colors[i].b - e.color[2]));
  e.share = 1 + 6 * active / e.known;
  e.contrast = magnitude_class(4 * contrast / (total * static_cast<uint32_t>(unit)));
  e.activity = magnitude_class(4 * residuals / total);
  return e;
}

/// The chances of all decisions of a part. A coder decides, and lets chances learn:
///   bool decide(MixedChance& chance, bool known)
class ColorModel {
 public:
  ColorModel() : exact_weights_(exact_kinds), weights_(values * nodes * known_kinds) {
    exact_[0].resize(known_most * magnitude_classes * magnitude_classes);
    exact_[1].resize(history_size * known_most * shares);
    exact_[2].resize(8 * 8 * shares);
    chances_.resize(size_t{values} * nodes * mixed_contexts * context_size);
  }

  /// Whether a colour is as expected.
  template <class Coder>
  bool as_expected(Coder& coder, const Expected& e, bool known) {
    const uint32_t near = std::min(e.known, known_most - 1);
    MixedChance chance(
        {&exact_[0][(near * magnitude_classes + e.contrast) * magnitude_classes + e.activity],
         &exact_[1][(history_ * known_most + near) * shares + e.share],
         &exact_[2][(e.faces * 8 + (e.bit & 7)) * shares + e.share]},
        exact_weights_[near + known_most * ((e.contrast > 0 ? 1 : 0) + (e.activity > 0 ? 2 : 0))]);
    const bool yes = coder.decide(chance, known);
    history_ = (history_ << 1 | (yes ? 0u : 1u)) & (history_size - 1);
    return yes;
  }

  /// What is coded of a point (ColorSteps::coded).
  template <class Coder>
  Channels point(Coder& coder, const Expected& e, const Channels& known) {
    const uint32_t few = std::min(e.known, known_kinds - 1);
    const auto tint = [&](size_t c) { return static_cast<uint32_t>(((e.color[c] - e.color[1]) >> 4) + 16); };
    Channels v;
    v[0] =
        value(coder, 0, few,
              {e.activity, e.contrast, static_cast<uint32_t>(e.color[1] >> 4) * known_kinds + few}, known[0]);
    const uint32_t g = signed_class(v[0]);
    v[1] = value(coder, 1, few,
                 {g * magnitude_classes + e.activity, g * magnitude_classes + e.contrast, g * 32 + tint(0)},
                 known[1]);
    const uint32_t r = signed_class(v[1]);
    v[2] = value(coder, 2, few, {g * 16 + r, r * magnitude_classes + e.contrast, r * 32 + tint(2)}, known[2]);
    return v;
  }

  static constexpr uint64_t bytes = 1 << 20;  ///< that it takes, about

 private:
  static constexpr uint32_t known_most = 10, shares = 8, history_size = 64, known_kinds = 4;
  static constexpr uint32_t exact_kinds = known_most * 4;
  static constexpr uint32_t values = 3, context_size = 512;
  // The decisions of a value: zero, negative, ten of its exponent, of the bits below the highest one the
  // first by the exponent, the second by both.
  static constexpr uint32_t sign_node = 1, exponent_node = 2, most_exponent = 8, first_node = 10,
                            second_node = 18, nodes = 34;

  static uint32_t signed_class(int32_t v) {
    const auto magnitude = static_cast<uint32_t>(std::min(std::abs(v), 7));
    return v < 0 ? 8 + magnitude : magnitude;
  }

  /// A value from -511 to 511.
  template <class Coder>
  int32_t value(Coder& coder, uint32_t number, uint32_t few,
                const std::array<uint32_t, mixed_contexts>& contexts, int32_t known) {
    const auto decide = [&](uint32_t node, bool yes) {
      const uint32_t at = number * nodes + node;
      AdaptiveChance* const chances = &chances_[size_t{at} * mixed_contexts * context_size];
      MixedChance chance({chances + contexts[0], chances + context_size + contexts[1],
                          chances + 2 * context_size + contexts[2]},
                         weights_[at * known_kinds + few]);
      return coder.decide(chance, yes);
    };
    if (decide(0, known == 0)) return 0;
    const bool negative = decide(sign_node, known < 0);
    const auto magnitude = static_cast<uint32_t>(std::abs(known));
    const uint32_t most = known != 0 ? static_cast<uint32_t>(std::bit_width(magnitude)) - 1 : 0;
    uint32_t exponent = 0;
    while (exponent < most_exponent && decide(exponent_node + exponent, exponent < most)) ++exponent;
    uint32_t v = 1;
    for (uint32_t i = 0; i < exponent; ++i) {
      const bool bit = (magnitude >> (exponent - 1 - i) & 1) != 0;
      const bool yes = i == 0   ? decide(first_node + exponent - 1, bit)
                       : i == 1 ? decide(second_node + 2 * (exponent - 1) + (v & 1), bit)
                                : coder.decide_evenly(bit);
      v = 2 * v + (yes ? 1 : 0);
    }
    return negative ? -static_cast<int32_t>(v) : static_cast<int32_t>(v);
  }

  std::array<std::vector<AdaptiveChance>, mixed_contexts> exact_;
  std::vector<MixWeights> exact_weights_;
  std::vector<AdaptiveChance> chances_;
  std::vector<MixWeights> weights_;
  uint32_t history_ = 0;
};

}  // namespace voxkit::color
