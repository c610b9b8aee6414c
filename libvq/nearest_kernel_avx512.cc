#include "libvq/nearest_kernel_x86.h"

#ifdef VOXKIT_AVX2

#include <immintrin.h>

namespace voxkit::vq {
namespace {

#define VOXKIT_CODE VOXKIT_AVX512_CODE
#define VOXKIT_INLINE VOXKIT_CODE [[gnu::always_inline]] inline

constexpr size_t lanes = 16;
using Vector = __m512i;

VOXKIT_INLINE Vector load(const void* from) {
  return _mm512_loadu_si512(from);
}
template <class T>
VOXKIT_INLINE Vector fill(T number) {
  return _mm512_set1_epi32(static_cast<int>(number));
}
VOXKIT_INLINE Vector add(Vector a, Vector b) {
  return _mm512_add_epi32(a, b);
}
VOXKIT_INLINE Vector subtract(Vector a, Vector b) {
  return _mm512_sub_epi32(a, b);
}
VOXKIT_INLINE Vector add_products(Vector to, Vector a, Vector b) {
  return _mm512_dpwssd_epi32(to, a, b);
}
VOXKIT_INLINE Vector difference(Vector a, Vector b) {
  return _mm512_sub_epi16(a, b);
}
VOXKIT_INLINE Vector gap(Vector x, Vector least, Vector most) {
  const Vector outside = _mm512_max_epi16(_mm512_sub_epi16(least, x), _mm512_sub_epi16(x, most));
  return _mm512_max_epi16(outside, _mm512_setzero_si512());
}
VOXKIT_INLINE uint32_t sign_mask(Vector v) {
  return _mm512_movepi32_mask(v);
}
VOXKIT_INLINE void compress(uint32_t mask, Vector v, void* to) {
  _mm512_storeu_si512(to, _mm512_maskz_compress_epi32(static_cast<__mmask16>(mask), v));
}
VOXKIT_INLINE uint32_t sum(Vector v) {
  // With masks, for g++ 12 warns of those without.
  const __m256i half = _mm256_add_epi32(_mm512_maskz_extracti64x4_epi64(0xff, v, 0),
                                        _mm512_maskz_extracti64x4_epi64(0xff, v, 1));
  __m128i s = _mm_add_epi32(_mm256_castsi256_si128(half), _mm256_extracti128_si256(half, 1));
  s = _mm_add_epi32(s, _mm_shuffle_epi32(s, 0x4e));
  s = _mm_add_epi32(s, _mm_shuffle_epi32(s, 0xb1));
  return static_cast<uint32_t>(_mm_cvtsi128_si32(s));
}

#include "libvq/nearest_kernel_body.h"

}  // namespace

const Kernels& avx512_kernels(bool narrow) {
  return narrow ? narrow_kernels : wide_kernels;
}

}  // namespace voxkit::vq

#endif
