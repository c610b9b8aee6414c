// What of a row is known before its first voxel: its contexts, and its prediction but for the part of each
// voxel's left neighbour.
#pragma once

#include <algorithm>
#include <cstring>

#include "libpage/model_data.h"
#include "libpage/parent_rows.h"

namespace voxkit::page {

/// Samples of up to 16 bits, kept as signed ones, so that products of 16 bits do.
struct Narrow {
  using Stored = int16_t;
  using Sum = int32_t;
  static constexpr int32_t offset = 32768;
  static constexpr uint32_t escape_bits = 17;
  /// Half a range in steps of the quantiser, at most 1023.
  static int range_share(int16_t lowest, int16_t highest, uint32_t half_steps) {
    const auto range = static_cast<uint16_t>(highest - lowest);
    const uint32_t share = static_cast<uint32_t>(range) * static_cast<uint16_t>(half_steps) >> 16;
    return static_cast<int>(std::min(share, 1023u));
  }
};
/// Samples of up to 32 bits.
struct Wide {
  using Stored = uint32_t;
  using Sum = int64_t;
  static constexpr int64_t offset = 0;
  static constexpr uint32_t escape_bits = 32;
  static int range_share(uint32_t lowest, uint32_t highest, uint32_t half_steps) {
    return static_cast<int>(std::min<uint64_t>(uint64_t{highest - lowest} * half_steps >> 16, 1023));
  }
};

/// The part of a page that what comes next depends on.
template <class Width>
struct Memory {
  alignas(64) Planes<typename Width::Stored> samples{};
  alignas(64) Planes<uint16_t> magnitudes{};
  alignas(64) ParentRows<typename Width::Stored> parents;  ///< of models that have these
};

template <class Width, class T>
void load_parents(const ModelData& model, const Parent<T>& parent, Extent extent, Memory<Width>& memory) {
  using Stored = typename Width::Stored;
  memory.parents.load(parent, extent, [&](T sample) {
    return static_cast<Stored>(model.nearest(sample) - static_cast<uint32_t>(Width::offset));
  });
}

template <class Width>
struct RowPlan {
  alignas(64) std::array<typename Width::Sum, max_side> base;  ///< of the predicted sample, before the shift
  std::array<typename Width::Sum, max_side> left_weight, second_left_weight;
  std::array<uint16_t, max_side> activity;
  uint32_t context;  ///< of activity 0, of the first voxel
};

/// Added before the shift, for the nearest whole number; the lower one of two.
inline constexpr int32_t rounding = weight_one / 2 - 1;

template <class Width, class Rows>
[[gnu::always_inline]] inline typename Width::Sum base_at(const Weights& w, const Rows& rows, int x) {
  using Sum = typename Width::Sum;
  Sum sum = rounding;
  for (int t = 0; t < left_tap; ++t)
    sum += static_cast<Sum>(w[static_cast<size_t>(t)]) *
           static_cast<Sum>(rows[static_cast<size_t>(t / 3)][x + t % 3 - 1]);
  return sum + static_cast<Sum>(w[second_above_tap]) * static_cast<Sum>(rows[4][x]) +
         static_cast<Sum>(w[second_behind_tap]) * static_cast<Sum>(rows[5][x]);
}

/// Least and greatest of neighbours in a row.
template <class Width>
struct Ranges {
  std::array<typename Width::Stored, row_stride> least, greatest;
};

/// Of the twelve taps in earlier rows of each voxel.
template <class Width, class Rows>
[[gnu::always_inline]] inline void find_ranges(const Rows& rows, Ranges<Width>& out) {
  using Stored = typename Width::Stored;
  // Of four rows, then of three neighbours in these.
  std::array<Stored, row_stride> least, greatest;
  for (int x = -1; x <= max_side; ++x) {
    const Stored a = rows[0][x], b = rows[1][x], c = rows[2][x], d = rows[3][x];
    const Stored low1 = a < b ? a : b, low2 = c < d ? c : d, high1 = a > b ? a : b, high2 = c > d ? c : d;
    least[static_cast<size_t>(x + row_start)] = low1 < low2 ? low1 : low2;
    greatest[static_cast<size_t>(x + row_start)] = high1 > high2 ? high1 : high2;
  }
  const Stored *low = least.data() + row_start, *high = greatest.data() + row_start;
  for (int x = 0; x < max_side; ++x) {
    const Stored low1 = low[x - 1] < low[x + 1] ? low[x - 1] : low[x + 1];
    const Stored high1 = high[x - 1] > high[x + 1] ? high[x - 1] : high[x + 1];
    out.least[static_cast<size_t>(x)] = low1 < low[x] ? low1 : low[x];
    out.greatest[static_cast<size_t>(x)] = high1 > high[x] ? high1 : high[x];
  }
}

/// Activity from the magnitudes in earlier rows, none in the first one, and the share of ranges.
template <class Width>
[[gnu::always_inline]] inline void find_activity(int y, int z, const Memory<Width>& memory,
                                                 const std::array<uint16_t, max_side>& share,
                                                 RowPlan<Width>& plan) {
  if (y == 0 && z == 0) {
    for (size_t x = 0; x < max_side; ++x)
      plan.activity[x] = std::min(share[x], static_cast<uint16_t>(most_row_activity));
    return;
  }
  const uint16_t* above = row_of(memory.magnitudes, std::max(y - 1, 0), z);
  const uint16_t* behind = row_of(memory.magnitudes, y, std::max(z - 1, 0));
  if (y == 0) above = behind;
  if (z == 0) behind = above;
  for (int x = 0; x < max_side; ++x) {
    const auto at = static_cast<size_t>(x);
    const int activity =
        2 * (above[x] + behind[x]) + above[x - 1] + above[x + 1] + behind[x - 1] + behind[x + 1] + share[at];
    plan.activity[at] = static_cast<uint16_t>(std::min(activity, most_row_activity));
  }
  plan.activity[0] = static_cast<uint16_t>(
      std::min<uint32_t>(plan.activity[0] + left_share * above[0], uint32_t{most_row_activity}));
}

template <class Width, bool avx2>
[[gnu::always_inline]] inline void plan_alone(const ModelData& model, Extent extent, int y, int z,
                                              const Memory<Width>& memory, RowPlan<Width>& plan) {
  using Sum = typename Width::Sum;
  const auto rows = tap_rows(memory.samples, y, z, extent.ny);
  const int py = place(y, extent.ny);
  const auto weights_of = [&](int px) -> const Weights& {
    return model.weights[static_cast<size_t>(model.classes.of(px, py, z))];
  };
  const Weights& weights = weights_of(inner);
#ifdef VOXKIT_AVX2
  if constexpr (avx2 && std::is_same_v<Width, Narrow>) {
    const std::array<const int16_t*, row_taps(false)> taps = {
        rows[0] - 1, rows[0],     rows[0] + 1, rows[1] - 1, rows[1],     rows[1] + 1, rows[2] - 1,
        rows[2],     rows[2] + 1, rows[3] - 1, rows[3],     rows[3] + 1, rows[4],     rows[5]};
    const auto row_class = static_cast<size_t>(model.classes.of(0, py, z)) / 3;
    sum_taps_avx2(taps, model.pairs[row_class].data(), rounding, plan.base.data());
  } else
#endif
    for (int x = 0; x < max_side; ++x) plan.base[static_cast<size_t>(x)] = base_at<Width>(weights, rows, x);
  plan.left_weight.fill(weights[left_tap]);
  plan.second_left_weight.fill(weights[second_left_tap]);
  const auto at_side = [&](int x, int px) {
    const Weights& w = weights_of(px);
    plan.base[static_cast<size_t>(x)] = base_at<Width>(w, rows, x);
    plan.left_weight[static_cast<size_t>(x)] = w[left_tap];
    plan.second_left_weight[static_cast<size_t>(x)] = w[second_left_tap];
  };
  if (extent.nx > 1) at_side(extent.nx - 1, last);
  at_side(0, first);

  plan.context = first_context(y, z);
  if (y == 0 && z == 0) {
    plan.base[0] =
        (static_cast<Sum>(model.background) - static_cast<Sum>(Width::offset)) * weight_one + rounding;
    plan.activity.fill(0);
    plan.activity[0] = most_row_activity;
    return;
  }
  Ranges<Width> ranges;
  find_ranges<Width>(rows, ranges);
  std::array<uint16_t, max_side> share;
  for (size_t x = 0; x < max_side; ++x)
    share[x] =
        static_cast<uint16_t>(Width::range_share(ranges.least[x], ranges.greatest[x], model.half_steps));
  find_activity(y, z, memory, share, plan);
}

template <class Width, bool avx2>
[[gnu::always_inline]] inline void plan_with_parents(const ModelData& model, Extent extent, int y, int z,
                                                     const Memory<Width>& memory, RowPlan<Width>& plan) {
  using Sum = typename Width::Sum;
  using Stored = typename Width::Stored;
  const auto rows = tap_rows(memory.samples, y, z, extent.ny);
  const auto parents = memory.parents.around(y, z);
  const auto row_class = static_cast<size_t>(model.classes.of(0, model.classes.along(y, extent.ny), z)) / 4;
  const RowWeights& weights = model.rows[row_class];
  // Each tap's row, from where its weight for voxel 0 applies.
  const std::array<const Stored*, row_taps(true)> taps = {
      rows[0] - 1, rows[0],        rows[0] + 1,    rows[1] - 1, rows[1],        rows[1] + 1,
      rows[2] - 1, rows[2],        rows[2] + 1,    rows[3] - 1, rows[3],        rows[3] + 1,
      rows[4],     rows[5],        parents[0] - 2, parents[0],  parents[0] + 2, parents[1] - 2,
      parents[1],  parents[1] + 2, parents[2] - 2, parents[2],  parents[2] + 2, parents[3] - 2,
      parents[3],  parents[3] + 2, parents[4],     parents[5]};
#ifdef VOXKIT_AVX2
  if constexpr (avx2 && std::is_same_v<Width, Narrow>) {
    sum_taps_avx2(taps, model.pairs[row_class].data(), rounding, plan.base.data());
  } else
#endif
    for (size_t x = 0; x < max_side; ++x) {
      Sum sum = rounding;
#pragma GCC unroll 32
      for (size_t i = 0; i < taps.size(); ++i)
        sum += static_cast<Sum>(weights[row_tap(i)][x]) * static_cast<Sum>(taps[i][x]);
      plan.base[x] = sum;
    }
  for (size_t x = 0; x < max_side; ++x) {
    plan.left_weight[x] = weights[left_tap][x];
    plan.second_left_weight[x] = weights[second_left_tap][x];
  }
  if (extent.nx > 1 && extent.nx < max_side) {
    const auto x = static_cast<size_t>(extent.nx - 1);
    const Weights& w = model.weights[4 * row_class + 3];
    Sum sum = rounding;
    for (size_t i = 0; i < taps.size(); ++i)
      sum += static_cast<Sum>(w[row_tap(i)]) * static_cast<Sum>(taps[i][x]);
    plan.base[x] = sum;
    plan.left_weight[x] = w[left_tap];
    plan.second_left_weight[x] = w[second_left_tap];
  }

  plan.context = first_child(y, z) * activity_steps;
  // Half of each range: with the parent of what is around a voxel, and of the parents.
  Ranges<Width> ranges;
  const bool first_row = y == 0 && z == 0;
  if (!first_row) find_ranges<Width>(rows, ranges);
  std::array<uint16_t, max_side> share;
  for (int x = 0; x < max_side; ++x) {
    const auto at = static_cast<size_t>(x);
    const Stored parent = parents[0][x];
    Stored low = parent, high = parent;
    for (const Stored value :
         {parents[0][x - 2], parents[0][x + 2], parents[1][x], parents[2][x], parents[4][x], parents[5][x]}) {
      low = value < low ? value : low;
      high = value > high ? value : high;
    }
    Stored near_low = first_row ? parent : ranges.least[at];
    Stored near_high = first_row ? parent : ranges.greatest[at];
    near_low = parent < near_low ? parent : near_low;
    near_high = parent > near_high ? parent : near_high;
    share[at] = static_cast<uint16_t>((Width::range_share(low, high, model.half_steps) +
                                       Width::range_share(near_low, near_high, model.half_steps)) /
                                      2);
  }
  find_activity(y, z, memory, share, plan);
}

/// `avx2`: in code for that.
template <class Width, bool avx2>
[[gnu::always_inline]] inline void plan_row(const ModelData& model, Extent extent, int y, int z,
                                            const Memory<Width>& memory, RowPlan<Width>& plan) {
  if (model.classes.parents)
    plan_with_parents<Width, avx2>(model, extent, y, z, memory, plan);
  else
    plan_alone<Width, avx2>(model, extent, y, z, memory, plan);
}

/// Copies of the ends of a row beside it.
template <class Stored>
[[gnu::always_inline]] inline void pad_row(Stored* row, int nx) {
  row[-1] = row[0];
  row[nx] = row[nx - 1];
}

/// What a voxel's left neighbours add to its plan.
template <class Width>
struct Left {
  int64_t sample = 0, second = 0;
  uint32_t magnitude = 0;
};

/// Before the shift.
template <class Width>
[[gnu::always_inline]] inline int64_t predict(const RowPlan<Width>& plan, size_t x, const Left<Width>& left) {
  return plan.base[x] + plan.left_weight[x] * left.sample + plan.second_left_weight[x] * left.second;
}
template <class Width>
[[gnu::always_inline]] inline uint32_t activity_at(const RowPlan<Width>& plan, size_t x,
                                                   const Left<Width>& left) {
  return plan.activity[x] + left_share * left.magnitude;
}
/// 1 where the prediction lies above the whole number next to it: then the first of two small residuals of
/// equal size is the positive one, as it is the likelier.
[[gnu::always_inline]] inline uint32_t mirror_of(int64_t mean) {
  return static_cast<uint32_t>(mean) >> (weight_bits - 1) & 1u;
}

}  // namespace voxkit::page
