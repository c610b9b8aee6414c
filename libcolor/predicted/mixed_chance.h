// How probable a decision is, from what was decided before it in several contexts: each has a chance that
// adapts, and they are mixed with weights that adapt as well (M. Mahoney, Adaptive weighing of context models
// for lossless data compression, 2005). Whole numbers alone. File: formats/FORMAT.md, section 4.12.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "libpage/decision.h"

namespace voxkit::color {

/// Of a context: that the decision is yes, in parts of 2^16, and how often there was one.
struct AdaptiveChance {
  uint16_t chance = 1 << 15;
  uint16_t seen = 0;

  static constexpr uint32_t most_seen = 127;
  void learn(bool yes) {
    const int32_t target = yes ? 0xffff : 0;
    chance = static_cast<uint16_t>(chance + ((target - chance) * rates[seen] >> 16));
    if (seen < most_seen) ++seen;
  }

 private:
  static constexpr std::array<int32_t, most_seen + 1> rates = [] {
    std::array<int32_t, most_seen + 1> of{};
    for (uint32_t n = 0; n <= most_seen; ++n) of[n] = (1 << 16) / static_cast<int32_t>(n + 2);
    return of;
  }();
};

/// The logistic function and its inverse: chances in parts of 4096, their logarithms in parts of 256.
namespace logistic {

inline constexpr int32_t most = 2047;
/// 4096 / (1 + e^-x) at x = -8, -7.5 ... 8.
inline constexpr std::array<int32_t, 33> knots = {
    1,    2,    4,    6,    10,   17,   27,   45,   74,   120,  194,  311,  488,  747,  1102, 1546, 2048,
    2550, 2994, 3349, 3608, 3785, 3902, 3976, 4022, 4051, 4069, 4079, 4086, 4090, 4092, 4094, 4095};
constexpr int32_t between_knots(int32_t x) {
  const auto knot = static_cast<size_t>((x + 2048) >> 7);
  const int32_t rest = (x + 2048) & 127;
  return (knots[knot] * (128 - rest) + knots[knot + 1] * rest + 64) >> 7;
}
inline constexpr std::array<uint16_t, 2 * most + 1> chances = [] {
  std::array<uint16_t, 2 * most + 1> of{};
  for (int32_t x = -most; x <= most; ++x)
    of[static_cast<size_t>(x + most)] = static_cast<uint16_t>(between_knots(x));
  return of;
}();
constexpr int32_t chance(int32_t x) {
  return chances[static_cast<size_t>(std::clamp(x, -most, most) + most)];
}
/// Of a chance: the least x that has it, or a greater one.
inline constexpr std::array<int16_t, 4096> logs = [] {
  std::array<int16_t, 4096> of{};
  size_t next = 0;
  for (int32_t x = -most; x <= most; ++x)
    for (; next <= static_cast<size_t>(between_knots(x)); ++next) of[next] = static_cast<int16_t>(x);
  for (; next < of.size(); ++next) of[next] = most;
  return of;
}();

}  // namespace logistic

/// Contexts of a decision.
inline constexpr size_t mixed_contexts = 3;

/// One 65536th is 1.
struct MixWeights {
  std::array<int32_t, mixed_contexts> of{26214, 26214, 26214};
};

/// A decision that is about to be made: what its contexts say, together.
class MixedChance {
 public:
  MixedChance(const std::array<AdaptiveChance*, mixed_contexts>& contexts, MixWeights& weights)
      : contexts_(contexts), weights_(weights) {
    int32_t sum = 0;
    for (size_t i = 0; i < mixed_contexts; ++i) {
      logs_[i] = logistic::logs[contexts[i]->chance >> 4];
      sum += weights.of[i] * logs_[i];
    }
    chance_ = logistic::chance(sum >> 16);
  }
  /// Of yes, in parts of 2048: neither 0 nor all.
  uint32_t part() const { return static_cast<uint32_t>(std::clamp(chance_ >> 1, 1, 2047)); }
  /// What it was.
  void learn(bool yes) {
    const int32_t error = ((yes ? 4096 : 0) - chance_) * 6;
    for (size_t i = 0; i < mixed_contexts; ++i) {
      weights_.of[i] =
          std::clamp(weights_.of[i] + ((logs_[i] * error + 0x8000) >> 16), -most_weight, most_weight);
      contexts_[i]->learn(yes);
    }
  }

 private:
  static constexpr int32_t most_weight = 1 << 18;  // the sum stays within 32 bits
  std::array<AdaptiveChance*, mixed_contexts> contexts_;
  MixWeights& weights_;
  std::array<int32_t, mixed_contexts> logs_;
  int32_t chance_;
};

}  // namespace voxkit::color
