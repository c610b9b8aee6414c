#include "libpage/residuals.h"

#include <algorithm>
#include <bit>
#include <cstdlib>

#include "formats/cpu.h"
#include "libpage/row.h"

namespace voxkit::page {
namespace {

/// A row of which all is known before, as there is no bound. The loops are of whole vectors; what lies behind
/// the row's end means nothing.
template <class Width>
[[gnu::always_inline]] inline void subtract_row(const ModelData& model, const RowPlan<Width>& plan,
                                                const typename Width::Stored* row, uint16_t* magnitudes,
                                                uint32_t* folded, uint8_t* contexts) {
  using Sum = typename Width::Sum;
  constexpr Sum lowest = -Sum{Width::offset};
  const Sum highest = static_cast<Sum>(int64_t{model.max_value} - Width::offset);
  alignas(64) std::array<Sum, max_side> left, second;
  for (int x = 0; x < max_side; ++x) {
    left[static_cast<size_t>(x)] = static_cast<Sum>(row[x - 1]);
    second[static_cast<size_t>(x)] = static_cast<Sum>(row[x - 2]);
  }
  left[0] = second[0] = 0;
  second[1] = static_cast<Sum>(row[0]);
  alignas(64) std::array<uint32_t, max_side> sizes;
  for (size_t x = 0; x < max_side; ++x) {
    const Sum mean = plan.base[x] + plan.left_weight[x] * left[x] + plan.second_left_weight[x] * second[x];
    Sum predicted = mean >> weight_bits;
    predicted = predicted < lowest ? lowest : predicted;
    predicted = predicted > highest ? highest : predicted;
    // Those of 32 bits count modulo 2^32.
    const auto residual = static_cast<int32_t>(static_cast<uint32_t>(static_cast<Sum>(row[x]) - predicted));
    folded[x] = fold(residual, mirror_of(mean));
    const uint32_t size = magnitude(folded[x]);
    sizes[x] = size < most_magnitude ? size : most_magnitude;
  }
  for (size_t x = 0; x < max_side; ++x) magnitudes[x] = static_cast<uint16_t>(sizes[x]);
  const uint32_t next_child = model.classes.parents ? activity_steps : 0;
  uint32_t before = 0;
  for (size_t x = 0; x < max_side; ++x) {
    const uint32_t activity = plan.activity[x] + left_share * before;
    contexts[x] =
        static_cast<uint8_t>(plan.context + (x % 2 != 0 ? next_child : 0) + step_of_activity<1>[activity]);
    before = sizes[x];
  }
}

/// Whole steps in a number below 2^33.
template <class Width>
struct SizeOverStep {
  explicit SizeOverStep(uint64_t of) : step(of) {}
  int64_t operator()(uint64_t size) const { return static_cast<int64_t>(size / step); }
  uint64_t step;
};
/// Of 16 bits, sizes and steps are below 2^17: a page with a larger step has one value. The reciprocal is
/// then off by less than what a size of 2^19 would show.
template <>
struct SizeOverStep<Narrow> {
  explicit SizeOverStep(uint64_t step) : reciprocal((uint64_t{1} << 36) / step + 1) {}
  int64_t operator()(uint64_t size) const { return static_cast<int64_t>(size * reciprocal >> 36); }
  uint64_t reciprocal;
};

/// Voxel by voxel: each is predicted from what the one before was decoded as. Returns how many are solid.
template <class Width>
[[gnu::always_inline]] inline size_t quantise_row(const ModelData& model, const RowPlan<Width>& plan, int nx,
                                                  const uint32_t* samples, uint32_t solid,
                                                  typename Width::Stored* row, uint16_t* magnitudes,
                                                  uint32_t* folded_out, uint8_t* contexts) {
  constexpr int64_t lowest = -int64_t{Width::offset};
  const int64_t highest = int64_t{model.max_value} - Width::offset;
  const auto step = static_cast<int64_t>(model.step());
  const auto bound = static_cast<int64_t>(model.max_error);
  const SizeOverStep<Width> over_step(model.step());
  const uint32_t next_child = model.classes.parents ? activity_steps : 0;
  Left<Width> left;
  size_t coded = 0;
  for (size_t x = 0; x < static_cast<size_t>(nx); ++x) {
    const int64_t mean = predict(plan, x, left);
    int64_t decoded = std::clamp(mean >> weight_bits, lowest, highest);
    uint32_t size = 0;
    if (solid >> x & 1) {
      const int64_t difference = int64_t{samples[x]} - Width::offset - decoded;
      const int64_t steps = over_step(static_cast<uint64_t>(std::abs(difference) + bound));
      const int64_t residual = difference < 0 ? -steps : steps;
      decoded = std::clamp(decoded + residual * step, lowest, highest);
      const uint32_t folded = fold(static_cast<int32_t>(residual), mirror_of(mean));
      contexts[coded] = static_cast<uint8_t>(plan.context + (x % 2 != 0 ? next_child : 0) +
                                             step_of_activity<1>[activity_at(plan, x, left)]);
      folded_out[coded++] = folded;
      size = std::min(magnitude(folded), most_magnitude);
    }
    left.second = x == 0 ? decoded : left.sample;
    left.sample = decoded;
    left.magnitude = size;
    row[x] = static_cast<typename Width::Stored>(decoded);
    magnitudes[x] = static_cast<uint16_t>(size);
  }
  return coded;
}

/// Void voxels of a row as they are predicted, which needs no more of it than what is solid.
template <class Width>
[[gnu::always_inline]] inline void predict_void(const ModelData& model, const RowPlan<Width>& plan,
                                                uint32_t is_void, typename Width::Stored* row) {
  constexpr int64_t lowest = -int64_t{Width::offset};
  const int64_t highest = int64_t{model.max_value} - Width::offset;
  for (; is_void != 0; is_void &= is_void - 1) {
    const auto x = static_cast<size_t>(std::countr_zero(is_void));
    Left<Width> left;
    if (x > 0) {
      left.sample = row[x - 1];
      left.second = row[x > 1 ? x - 2 : 0];
    }
    row[x] = static_cast<typename Width::Stored>(
        std::clamp(predict(plan, x, left) >> weight_bits, lowest, highest));
  }
}

/// Keeps what is of solid voxels.
[[gnu::always_inline]] inline size_t keep_solid(uint32_t solid, uint32_t* folded, uint8_t* contexts) {
  size_t count = 0;
  for (; solid != 0; solid &= solid - 1) {
    const auto x = static_cast<size_t>(std::countr_zero(solid));
    folded[count] = folded[x];
    contexts[count++] = contexts[x];
  }
  return count;
}

template <class Width, bool avx2>
[[gnu::always_inline]] inline void find_rows(const ModelData& model, const uint32_t* samples, Extent extent,
                                             const Mask* mask, Memory<Width>& memory, Residuals& out,
                                             uint32_t* decoded) {
  using Stored = typename Width::Stored;
  RowPlan<Width> plan;
  const auto nx = static_cast<size_t>(extent.nx);
  const uint32_t whole = (1u << nx) - 1;
  size_t coded = 0;
  for (int z = 0; z < extent.nz; ++z)
    for (int y = 0; y < extent.ny; ++y, samples += nx) {
      plan_row<Width, avx2>(model, extent, y, z, memory, plan);
      Stored* row = row_of(memory.samples, y, z);
      uint16_t* magnitudes = row_of(memory.magnitudes, y, z);
      const uint32_t solid = mask ? mask->row(y, z) & whole : whole;
      // There is room for a row of 16 behind any shorter one, so loops may go on to their vectors' ends.
      uint32_t* const folded = out.folded.data() + coded;
      uint8_t* const contexts = out.context.data() + coded;
      if (model.max_error != 0) {
        coded += quantise_row(model, plan, extent.nx, samples, solid, row, magnitudes, folded, contexts);
      } else {
        for (size_t x = 0; x < nx; ++x)
          row[x] = static_cast<Stored>(samples[x] - static_cast<uint32_t>(Width::offset));
        predict_void(model, plan, whole & ~solid, row);
        subtract_row(model, plan, row, magnitudes, folded, contexts);
        coded += solid == whole ? nx : keep_solid(solid, folded, contexts);
      }
      pad_row(row, extent.nx);
      pad_row(magnitudes, extent.nx);
      if (decoded)
        for (size_t x = 0; x < nx; ++x)
          *decoded++ = static_cast<uint32_t>(row[x]) + static_cast<uint32_t>(Width::offset);
    }
  out.count = static_cast<int>(coded);
}

template <class Width>
void find_rows_anywhere(const ModelData& model, const uint32_t* samples, Extent extent, const Mask* mask,
                        Memory<Width>& memory, Residuals& out, uint32_t* decoded) {
  find_rows<Width, false>(model, samples, extent, mask, memory, out, decoded);
}
#ifdef VOXKIT_AVX2
template <class Width>
VOXKIT_AVX2_CODE void find_rows_avx2(const ModelData& model, const uint32_t* samples, Extent extent,
                                     const Mask* mask, Memory<Width>& memory, Residuals& out,
                                     uint32_t* decoded) {
  find_rows<Width, true>(model, samples, extent, mask, memory, out, decoded);
}
#endif

template <class Width, class T>
void find(const ModelData& model, const uint32_t* samples, Extent extent, const Parent<T>& parent,
          const Mask* mask, Residuals& out, uint32_t* decoded) {
  Memory<Width> memory;
  if (model.classes.parents) load_parents(model, parent, extent, memory);
#ifdef VOXKIT_AVX2
  if (has_avx2()) return find_rows_avx2(model, samples, extent, mask, memory, out, decoded);
#endif
  find_rows_anywhere(model, samples, extent, mask, memory, out, decoded);
}

}  // namespace

template <class T>
void find_residuals(const ModelData& model, std::span<const uint32_t> samples, Extent extent,
                    const Parent<T>& parent, const Mask* mask, Residuals& out, uint32_t* decoded) {
  if (model.wide())
    find<Wide>(model, samples.data(), extent, parent, mask, out, decoded);
  else
    find<Narrow>(model, samples.data(), extent, parent, mask, out, decoded);
}
template void find_residuals(const ModelData&, std::span<const uint32_t>, Extent, const Parent<uint8_t>&,
                             const Mask*, Residuals&, uint32_t*);
template void find_residuals(const ModelData&, std::span<const uint32_t>, Extent, const Parent<uint16_t>&,
                             const Mask*, Residuals&, uint32_t*);
template void find_residuals(const ModelData&, std::span<const uint32_t>, Extent, const Parent<uint32_t>&,
                             const Mask*, Residuals&, uint32_t*);

}  // namespace voxkit::page
