#include "libvq/nearest_kernel_x86.h"

#ifdef VOXKIT_AVX2

#include <immintrin.h>

namespace voxkit::vq {
namespace {

#define VOXKIT_CODE VOXKIT_AVX2_CODE
#define VOXKIT_INLINE VOXKIT_CODE [[gnu::always_inline]] inline

constexpr size_t lanes = 8;
using Vector = __m256i;

/// For each mask, which lanes go first.
struct alignas(32) Lanes {
  std::array<uint32_t, lanes> from{};
};
constexpr auto compressing = [] {
  std::array<Lanes, 256> all{};
  for (size_t mask = 0; mask < all.size(); ++mask) {
    size_t to = 0;
    for (uint32_t i = 0; i < lanes; ++i)
      if (mask >> i & 1) all[mask].from[to++] = i;
  }
  return all;
}();

VOXKIT_INLINE Vector load(const void* from) {
  return _mm256_loadu_si256(static_cast<const __m256i*>(from));
}
template <class T>
VOXKIT_INLINE Vector fill(T number) {
  return _mm256_set1_epi32(static_cast<int>(number));
}
VOXKIT_INLINE Vector add(Vector a, Vector b) {
  return _mm256_add_epi32(a, b);
}
VOXKIT_INLINE Vector subtract(Vector a, Vector b) {
  return _mm256_sub_epi32(a, b);
}
VOXKIT_INLINE Vector add_products(Vector to, Vector a, Vector b) {
  return _mm256_add_epi32(to, _mm256_madd_epi16(a, b));
}
VOXKIT_INLINE Vector difference(Vector a, Vector b) {
  return _mm256_sub_epi16(a, b);
}
VOXKIT_INLINE Vector gap(Vector x, Vector least, Vector most) {
  const Vector outside = _mm256_max_epi16(_mm256_sub_epi16(least, x), _mm256_sub_epi16(x, most));
  return _mm256_max_epi16(outside, _mm256_setzero_si256());
}
VOXKIT_INLINE uint32_t sign_mask(Vector v) {
  return static_cast<uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(v)));
}
VOXKIT_INLINE void compress(uint32_t mask, Vector v, void* to) {
  const Vector first = _mm256_permutevar8x32_epi32(v, load(compressing[mask].from.data()));
  _mm256_storeu_si256(static_cast<__m256i*>(to), first);
}
VOXKIT_INLINE uint32_t sum(Vector v) {
  __m128i s = _mm_add_epi32(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
  s = _mm_add_epi32(s, _mm_shuffle_epi32(s, 0x4e));
  s = _mm_add_epi32(s, _mm_shuffle_epi32(s, 0xb1));
  return static_cast<uint32_t>(_mm_cvtsi128_si32(s));
}

#include "libvq/nearest_kernel_body.h"

}  // namespace

const Kernels& avx2_kernels(bool narrow) {
  return narrow ? narrow_kernels : wide_kernels;
}

}  // namespace voxkit::vq

#endif
