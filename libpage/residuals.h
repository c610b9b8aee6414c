// What a page's samples become: folded residuals of the quantiser and the contexts that they are coded in.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "libpage/model_data.h"
#include "libpage/page.h"

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
/// For 8, 16 and 32 bits of `parent`.
template <class T>
void find_residuals(const ModelData& model, std::span<const uint32_t> samples, Extent extent,
                    const Parent<T>& parent, const Mask* mask, Residuals& out, uint32_t* decoded = nullptr);

}  // namespace voxkit::page
