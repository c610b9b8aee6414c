// Decodes pages of equal extent side by side: each is a chain of steps that depend on each other, and while
// one waits, the others go on.
#pragma once

#include <algorithm>
#include <array>

#include "libpage/rans.h"
#include "libpage/row.h"

namespace voxkit::page {

/// Voxels of one page that are decoded: where they go.
template <class Width>
struct Lane {
  RansDecoder coder;
  Memory<Width> memory;
  RowPlan<Width> plan;
};

template <class Width>
inline constexpr auto bins = make_bins(Width::escape_bits);

template <class Width>
[[gnu::always_inline]] inline uint32_t decode_folded(RansDecoder& coder, const uint32_t* slots) {
  const uint32_t slot = slots[coder.state & (table_total - 1)];
  coder.state = (coder.state >> table_bits) * ((slot & (table_total - 1)) + 1) +
                (slot >> table_bits & (table_total - 1));
  const Bin bin = bins<Width>[slot >> (2 * table_bits)];
  if constexpr (Width::escape_bits <= 21) {
    const uint32_t raw = coder.raw(bin.raw_bits);
    coder.renew();
    return bin.base + raw;
  } else {
    coder.renew();
    const uint32_t low_bits = std::min(bin.raw_bits, 16u);
    const uint32_t low = coder.raw(low_bits);
    coder.renew();
    const uint32_t high = coder.raw(bin.raw_bits - low_bits);
    coder.renew();
    return bin.base + (high << low_bits | low);
  }
}

/// Calls `row(lane number, y, z, samples of the row)` for each row of each lane.
template <class Width, int lane_count, class RowOut>
[[gnu::always_inline]] inline void decode_lanes(const ModelData& model, Extent extent,
                                                std::array<Lane<Width>, lane_count>& lanes,
                                                const RowOut& row_out) {
  using Sum = typename Width::Sum;
  using Stored = typename Width::Stored;
  const uint32_t* const slots = model.slots.data();
  constexpr auto lowest = static_cast<Sum>(-static_cast<int64_t>(Width::offset));
  const auto highest = static_cast<Sum>(static_cast<int64_t>(model.max_value) - Width::offset);
  const uint64_t step = model.step();
  const bool wraps = model.max_error == 0 && Width::escape_bits == 32;
  for (int z = 0; z < extent.nz; ++z)
    for (int y = 0; y < extent.ny; ++y) {
      std::array<Stored*, lane_count> row;
      std::array<uint16_t*, lane_count> magnitudes;
      std::array<Left<Width>, lane_count> left{};
      std::array<RansDecoder, lane_count> coder;
      for (size_t n = 0; n < lane_count; ++n) {
        plan_row<Width>(model, extent, y, z, lanes[n].memory, lanes[n].plan);
        row[n] = row_of(lanes[n].memory.samples, y, z);
        magnitudes[n] = row_of(lanes[n].memory.magnitudes, y, z);
        coder[n] = lanes[n].coder;
      }
      const auto voxel = [&](size_t n, size_t x) __attribute__((always_inline)) {
        const RowPlan<Width>& plan = lanes[n].plan;
        const uint32_t folded =
            decode_folded<Width>(coder[n], slots + size_t{context_at(plan, x, left[n])} * table_total);
        const Sum mean = predict(plan, x, left[n]);
        const Sum predicted = std::clamp<Sum>(mean >> weight_bits, lowest, highest);
        const uint32_t mirror = mirror_of(mean);
        const auto residual = static_cast<int32_t>((static_cast<uint32_t>(unfold(folded)) ^ mirror) - mirror);
        Sum value;
        if constexpr (Width::escape_bits == 32) {
          value = wraps ? static_cast<Sum>(static_cast<uint32_t>(predicted) + static_cast<uint32_t>(residual))
                        : static_cast<Sum>(static_cast<uint64_t>(predicted) +
                                           static_cast<uint64_t>(int64_t{residual}) * step);
        } else {
          value = static_cast<Sum>(static_cast<uint32_t>(predicted) +
                                   static_cast<uint32_t>(residual) * static_cast<uint32_t>(step));
        }
        left[n].second = left[n].sample;
        left[n].sample = std::clamp(value, lowest, highest);
        left[n].magnitude = std::min(magnitude(folded), most_magnitude);
        row[n][x] = static_cast<Stored>(left[n].sample);
        magnitudes[n][x] = static_cast<uint16_t>(left[n].magnitude);
      };
      for (size_t n = 0; n < lane_count; ++n) {
        voxel(n, 0);
        left[n].second = left[n].sample;
      }
      for (size_t x = 1; x < static_cast<size_t>(extent.nx); ++x)
        for (size_t n = 0; n < lane_count; ++n) voxel(n, x);
      for (size_t n = 0; n < lane_count; ++n) {
        lanes[n].coder = coder[n];
        pad_row(row[n], extent.nx);
        pad_row(magnitudes[n], extent.nx);
        row_out(n, y, z, row[n]);
      }
    }
}

}  // namespace voxkit::page
