// Decodes pages of equal extent side by side: each is a chain of steps that depend on each other, and while
// one waits, the others go on.
#pragma once

#include <algorithm>
#include <array>
#include <utility>

#include "libpage/rans.h"
#include "libpage/row.h"

namespace voxkit::page {

/// Voxels of one page that are decoded: where they go.
template <class Width>
struct Lane {
  RansDecoder coder;
  Memory<Width> memory;
  RowPlan<Width> plan;
  const Mask* mask = nullptr;  ///< of pages with void voxels
};

template <class Width>
[[gnu::always_inline]] inline uint32_t decode_folded(RansDecoder& coder, const DecodingTable& table) {
  const uint64_t slot = coder.state & (table_total - 1);
  const uint64_t word = table.word[table.symbol_at[slot]];
  coder.state = (coder.state >> table_bits) * (word >> 40 & 0xfff) + slot - (word >> 52);
  const auto base = static_cast<uint32_t>(word), raw_bits = static_cast<uint32_t>(word >> 32 & 63);
  if constexpr (Width::escape_bits <= 21) {
    const uint32_t raw = coder.raw(raw_bits);
    coder.renew();
    return base + raw;
  } else {
    coder.renew();
    const uint32_t low_bits = std::min(raw_bits, 16u);
    const uint32_t low = coder.raw(low_bits);
    coder.renew();
    const uint32_t high = coder.raw(raw_bits - low_bits);
    coder.renew();
    return base + (high << low_bits | low);
  }
}

/// Pages have void voxels if `masked`; `avx2`: in code for that. Calls `row_out(lane number, samples of the
/// row)` for each row of each lane in order.
template <class Width, int lane_count, bool masked, bool avx2, class RowOut>
[[gnu::always_inline]] inline void decode_lanes(const ModelData& model, Extent extent,
                                                std::array<Lane<Width>, lane_count>& lanes,
                                                const RowOut& row_out) {
  using Stored = typename Width::Stored;
  constexpr int64_t lowest = -int64_t{Width::offset};
  const int64_t highest = int64_t{model.max_value} - Width::offset;
  const uint64_t step = model.step();
  const size_t next_child = model.classes.parents ? activity_steps * sizeof(DecodingTable) : 0;
  [[maybe_unused]] const bool wraps = model.max_error == 0;
  // Numbers of lanes are constants, so that what is of a lane can be in registers.
  const auto each = [](const auto& body) __attribute__((always_inline)) {
    [&]<size_t... n>(std::index_sequence<n...>) __attribute__((always_inline)) {
      (body(std::integral_constant<size_t, n>{}), ...);
    }
    (std::make_index_sequence<lane_count>{});
  };
  std::array<Stored*, lane_count> row;
  std::array<uint16_t*, lane_count> magnitudes;
  std::array<Left<Width>, lane_count> left{};
  std::array<RansDecoder, lane_count> coder;
  std::array<const std::byte*, lane_count> table_bytes;
  each([&](auto n) __attribute__((always_inline)) { coder[n] = lanes[n].coder; });
  for (int z = 0; z < extent.nz; ++z)
    for (int y = 0; y < extent.ny; ++y) {
      each([&](auto n) __attribute__((always_inline)) {
        plan_row<Width, avx2>(model, extent, y, z, lanes[n].memory, lanes[n].plan);
        row[n] = row_of(lanes[n].memory.samples, y, z);
        magnitudes[n] = row_of(lanes[n].memory.magnitudes, y, z);
        left[n] = {};
        table_bytes[n] = reinterpret_cast<const std::byte*>(model.decoding.data() + lanes[n].plan.context);
      });
      const auto voxel = [&](size_t n, size_t x) __attribute__((always_inline)) {
        const RowPlan<Width>& plan = lanes[n].plan;
        const auto* table = reinterpret_cast<const DecodingTable*>(
            table_bytes[n] + (next_child & (0 - (x & 1))) +
            size_t{8} * step_of_activity<sizeof(DecodingTable) / 8>[activity_at(plan, x, left[n])]);
        const bool is_void = masked && (lanes[n].mask->row(y, z) >> x & 1) == 0;
        const uint32_t folded = is_void ? 0 : decode_folded<Width>(coder[n], *table);
        const int64_t mean = predict(plan, x, left[n]);
        const int64_t predicted = std::clamp(mean >> weight_bits, lowest, highest);
        const int64_t negative = sign(folded, mirror_of(mean));
        const uint32_t size = magnitude(folded);
        auto value = static_cast<int64_t>(static_cast<uint64_t>(predicted - negative) +
                                          ((size * step) ^ static_cast<uint64_t>(negative)));
        if constexpr (Width::escape_bits == 32) value = wraps ? static_cast<uint32_t>(value) : value;
        left[n].second = left[n].sample;
        left[n].sample = std::clamp(value, lowest, highest);
        left[n].magnitude = std::min(size, most_magnitude);
        row[n][x] = static_cast<Stored>(left[n].sample);
        magnitudes[n][x] = static_cast<uint16_t>(left[n].magnitude);
      };
      each([&](auto n) __attribute__((always_inline)) {
        voxel(n, 0);
        left[n].second = left[n].sample;
      });
      for (size_t x = 1; x < static_cast<size_t>(extent.nx); ++x)
        each([&](auto n) __attribute__((always_inline)) { voxel(n, x); });
      each([&](auto n) __attribute__((always_inline)) {
        pad_row(row[n], extent.nx);
        pad_row(magnitudes[n], extent.nx);
        row_out(n, row[n]);
      });
    }
  each([&](auto n) __attribute__((always_inline)) { lanes[n].coder = coder[n]; });
}

}  // namespace voxkit::page
