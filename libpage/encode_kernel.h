// What a page's samples become: folded residuals of the quantiser and the contexts that they are coded in.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "libpage/row.h"

namespace voxkit::page {

/// Of each voxel in order.
struct Residuals {
  int count = 0;
  std::array<uint32_t, max_voxels> folded;
  std::array<uint8_t, max_voxels> context;
};

/// Quantises in closed loop: what is predicted from is what the decoder will have. Where `decoded` is given,
/// it receives that. Samples are at most `model.max_value`.
template <class Width>
void find_residuals(const ModelData& model, std::span<const uint32_t> samples, Extent extent, Residuals& out,
                    uint32_t* decoded = nullptr) {
  using Sum = typename Width::Sum;
  using Stored = typename Width::Stored;
  constexpr auto lowest = static_cast<Sum>(-static_cast<int64_t>(Width::offset));
  const auto highest = static_cast<Sum>(static_cast<int64_t>(model.max_value) - Width::offset);
  const auto step = static_cast<int64_t>(model.step());
  const auto bound = static_cast<int64_t>(model.max_error);
  Memory<Width> memory;
  RowPlan<Width> plan;
  size_t at = 0;
  for (int z = 0; z < extent.nz; ++z)
    for (int y = 0; y < extent.ny; ++y) {
      plan_row<Width>(model, extent, y, z, memory, plan);
      Stored* row = memory.samples[static_cast<size_t>(z & 1)][static_cast<size_t>(y)].data() + row_start;
      uint16_t* magnitudes = memory.magnitudes[static_cast<size_t>(z & 1)][static_cast<size_t>(y)].data() + row_start;
      Sum left = 0;
      for (size_t x = 0; x < static_cast<size_t>(extent.nx); ++x, ++at) {
        const Sum mean = (plan.base[x] + plan.left_weight[x] * left) >> weight_bits;
        const Sum predicted = std::clamp(mean, lowest, highest);
        const auto value = static_cast<Sum>(static_cast<int64_t>(samples[at]) - Width::offset);
        const int64_t difference = int64_t{value} - int64_t{predicted};
        int64_t residual = difference;
        left = value;
        if (bound != 0) {
          residual = difference < 0 ? -((bound - difference) / step) : (difference + bound) / step;
          left = static_cast<Sum>(std::clamp<int64_t>(predicted + residual * step, lowest, highest));
        }
        // Lossless ones of 32 bits count modulo 2^32.
        const uint32_t folded = fold(static_cast<int32_t>(static_cast<uint32_t>(residual)));
        row[x] = static_cast<Stored>(left);
        magnitudes[x] = static_cast<uint16_t>(std::min(magnitude(folded), most_magnitude));
        out.folded[at] = folded;
        out.context[at] = static_cast<uint8_t>(plan.context[x] / table_total);
        if (decoded) decoded[at] = static_cast<uint32_t>(static_cast<int64_t>(left) + Width::offset);
      }
      pad_row(row, extent.nx);
      pad_row(magnitudes, extent.nx);
    }
  out.count = static_cast<int>(at);
}

}  // namespace voxkit::page
