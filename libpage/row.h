// What of a row is known before its first voxel: its contexts, and its prediction but for the part of each
// voxel's left neighbour.
#pragma once

#include <algorithm>
#include <cstring>

#include "libpage/model_data.h"

namespace voxkit::page {

/// Samples of up to 16 bits, kept as signed ones, so that products of 16 bits do.
struct Narrow {
  using Stored = int16_t;
  using Sum = int32_t;
  static constexpr int32_t offset = 32768;
  static constexpr uint32_t escape_bits = 17;
};
/// Samples of up to 32 bits.
struct Wide {
  using Stored = uint32_t;
  using Sum = int64_t;
  static constexpr int64_t offset = 0;
  static constexpr uint32_t escape_bits = 32;
};

/// The part of a page that what comes next depends on.
template <class Width>
struct Memory {
  alignas(64) Planes<typename Width::Stored> samples{};
  alignas(64) Planes<uint16_t> magnitudes{};
};

template <class Width>
struct RowPlan {
  alignas(64) std::array<typename Width::Sum, max_side> base;  ///< rounded, before the shift
  std::array<typename Width::Sum, max_side> left_weight;
  std::array<uint32_t, max_side> context;
};

template <class Width>
[[gnu::always_inline]] inline void plan_row(const ModelData& model, Extent extent, int y, int z,
                                            const Memory<Width>& memory, RowPlan<Width>& plan) {
  using Sum = typename Width::Sum;
  const auto rows = tap_rows(memory.samples, y, z, extent.ny);
  const int py = place(y, extent.ny);
  constexpr Sum half = weight_one / 2;
  {
    const Weights& w = model.weights[static_cast<size_t>(class_of(inner, py, z > 0))];
    for (int x = 0; x < max_side; ++x) {
      Sum sum = half;
      for (int t = 0; t < left_tap; ++t)
        sum += static_cast<Sum>(w[static_cast<size_t>(t)]) * static_cast<Sum>(rows[static_cast<size_t>(t / 3)][x + t % 3 - 1]);
      plan.base[static_cast<size_t>(x)] = sum;
    }
    plan.left_weight.fill(w[left_tap]);
  }
  const auto at_side = [&](int x, int px) {
    const Weights& w = model.weights[static_cast<size_t>(class_of(px, py, z > 0))];
    Sum sum = half;
    for (int t = 0; t < left_tap; ++t)
      sum += static_cast<Sum>(w[static_cast<size_t>(t)]) * static_cast<Sum>(rows[static_cast<size_t>(t / 3)][x + t % 3 - 1]);
    plan.base[static_cast<size_t>(x)] = sum;
    plan.left_weight[static_cast<size_t>(x)] = w[left_tap];
  };
  if (extent.nx > 1) at_side(extent.nx - 1, last);
  at_side(0, first);
  if (y == 0 && z == 0)
    plan.base[0] = (static_cast<Sum>(model.background) - static_cast<Sum>(Width::offset)) * weight_one + half;

  const int context = first_context(y, z);
  plan.context.fill(static_cast<uint32_t>(context) * table_total);
  if (y == 0 && z == 0) return;
  const auto& now = memory.magnitudes[static_cast<size_t>(z & 1)];
  const auto& before = memory.magnitudes[static_cast<size_t>(~z & 1)];
  const uint16_t* above = now[static_cast<size_t>(std::max(y - 1, 0))].data() + row_start;
  const uint16_t* behind = before[static_cast<size_t>(y)].data() + row_start;
  if (y == 0) above = behind;
  if (z == 0) behind = above;
  std::array<uint16_t, max_side> activity;
  for (int x = 0; x < max_side; ++x)
    activity[static_cast<size_t>(x)] = static_cast<uint16_t>(2 * (above[x] + behind[x]) + above[x - 1] + above[x + 1] + behind[x - 1] + behind[x + 1]);
  for (size_t x = 0; x < static_cast<size_t>(extent.nx); ++x)
    plan.context[x] += uint32_t{model.step_of[activity[x]]} * table_total;
}

/// Copies of the ends of a row beside it.
template <class Stored>
[[gnu::always_inline]] inline void pad_row(Stored* row, int nx) {
  row[-1] = row[0];
  row[nx] = row[nx - 1];
}

}  // namespace voxkit::page
