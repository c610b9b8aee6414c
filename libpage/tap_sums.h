// Weights times taps of the 16 voxels of a row: two taps at a time where a machine multiplies pairs of 16
// bits.
#pragma once

#include <array>
#include <cstdint>

#include "formats/cpu.h"
#include "libpage/predictor.h"
#ifdef VOXKIT_AVX2
#include <immintrin.h>
#endif

namespace voxkit::page {

/// The weights of two taps for each voxel of a row, as the instructions have them that interleave two rows:
/// of voxels 0 to 3 and 8 to 11, then of 4 to 7 and 12 to 15, first one tap's and then the other's.
using WeightPairs = std::array<int16_t, 2 * max_side>;

inline WeightPairs paired(const std::array<int16_t, max_side>& first,
                          const std::array<int16_t, max_side>& second) {
  WeightPairs out{};
  for (size_t x = 0; x < max_side; ++x) {
    const size_t at = (x / 4 % 2) * max_side + (x / 8) * 8 + x % 4 * 2;
    out[at] = first[x];
    out[at + 1] = second[x];
  }
  return out;
}

#ifdef VOXKIT_AVX2
/// Of an even number of taps; `sum` begins with `start`. With the weights of a class sums are within 32 bits
/// in whatever order (most_weight).
template <size_t taps>
VOXKIT_AVX2_CODE inline void sum_taps_avx2(const std::array<const int16_t*, taps>& rows,
                                           const WeightPairs* weights, int32_t start, int32_t* sum) {
  static_assert(taps % 2 == 0 && max_side == 16);
  __m256i low = _mm256_set1_epi32(start), high = low;
  for (size_t i = 0; i < taps; i += 2, ++weights) {
    const __m256i a = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(rows[i])),
                  b = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(rows[i + 1]));
    const auto* const w = reinterpret_cast<const __m256i*>(weights->data());
    low = _mm256_add_epi32(low, _mm256_madd_epi16(_mm256_unpacklo_epi16(a, b), _mm256_loadu_si256(w)));
    high = _mm256_add_epi32(high, _mm256_madd_epi16(_mm256_unpackhi_epi16(a, b), _mm256_loadu_si256(w + 1)));
  }
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(sum), _mm256_permute2x128_si256(low, high, 0x20));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(sum + 8), _mm256_permute2x128_si256(low, high, 0x31));
}
#endif

}  // namespace voxkit::page
