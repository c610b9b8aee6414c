// What a page's samples become: folded residuals of the quantiser and the contexts that they are coded in.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "libpage/row.h"

namespace voxkit::page {

/// Of each solid voxel in order.
struct Residuals {
  int count = 0;
  std::array<uint32_t, max_voxels> folded;
  std::array<uint8_t, max_voxels> context;
};

/// Quantises in closed loop: what is predicted from is what the decoder will have. Where `decoded` is given,
/// it receives that. Samples are at most `model.max_value`; those of `parent` are, if the model has a
/// palette, not numbers of its entries. Void voxels of `mask`, if there is one, become what is predicted.
template <class Width, class T>
void find_residuals(const ModelData& model, std::span<const uint32_t> samples, Extent extent,
                    const Parent<T>& parent, const Mask* mask, Residuals& out, uint32_t* decoded = nullptr) {
  using Stored = typename Width::Stored;
  constexpr int64_t lowest = -int64_t{Width::offset};
  const int64_t highest = int64_t{model.max_value} - Width::offset;
  const auto step = static_cast<int64_t>(model.step());
  const auto bound = static_cast<int64_t>(model.max_error);
  Memory<Width> memory;
  RowPlan<Width> plan;
  const uint32_t next_child = model.classes.parents ? activity_steps : 0;
  if (model.classes.parents) load_parents(model, parent, extent, memory);
  size_t at = 0, coded = 0;
  for (int z = 0; z < extent.nz; ++z)
    for (int y = 0; y < extent.ny; ++y) {
      plan_row<Width>(model, extent, y, z, memory, plan);
      Stored* row = row_of(memory.samples, y, z);
      uint16_t* magnitudes = row_of(memory.magnitudes, y, z);
      Left<Width> left;
      const uint32_t solid = mask ? mask->row(y, z) : 0xffffu;
      for (size_t x = 0; x < static_cast<size_t>(extent.nx); ++x, ++at) {
        const auto context = static_cast<uint8_t>(plan.context + (x % 2 != 0 ? next_child : 0) +
                                                  step_of_activity<1>[activity_at(plan, x, left)]);
        const int64_t mean = predict(plan, x, left);
        const int64_t predicted = std::clamp(mean >> weight_bits, lowest, highest);
        const bool is_solid = (solid >> x & 1) != 0;
        const int64_t value = is_solid ? int64_t{samples[at]} - Width::offset : predicted;
        const int64_t difference = value - predicted;
        int64_t residual = difference;
        int64_t decoded_value = value;
        if (bound != 0) {
          residual = difference < 0 ? -((bound - difference) / step) : (difference + bound) / step;
          decoded_value = std::clamp(predicted + residual * step, lowest, highest);
        }
        // Lossless ones of 32 bits count modulo 2^32.
        const uint32_t folded = fold(static_cast<int32_t>(static_cast<uint32_t>(residual)), mirror_of(mean));
        if (is_solid) {
          out.context[coded] = context;
          out.folded[coded++] = folded;
        }
        left.second = x == 0 ? decoded_value : left.sample;
        left.sample = decoded_value;
        left.magnitude = std::min(magnitude(folded), most_magnitude);
        row[x] = static_cast<Stored>(decoded_value);
        magnitudes[x] = static_cast<uint16_t>(left.magnitude);
        if (decoded) decoded[at] = static_cast<uint32_t>(decoded_value + Width::offset);
      }
      pad_row(row, extent.nx);
      pad_row(magnitudes, extent.nx);
    }
  out.count = static_cast<int>(coded);
}

}  // namespace voxkit::page
