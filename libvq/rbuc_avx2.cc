// A vector holds one voxel of each of the 16 rows along x: lane y + 4z. Medians need the voxels before in x,
// y and z, so rows advance along a slope: in step t, row (y, z) decodes its voxel x = t - y - z. Then what it
// needs was decoded one or two steps earlier, by itself or in the lanes below it.
#include "libvq/rbuc_avx2.h"

#ifdef VOXKIT_AVX2

#include <immintrin.h>

#include <array>

#include "libvq/rbuc.h"

#define VOXKIT_INLINE VOXKIT_AVX2_CODE [[gnu::always_inline]] inline

namespace voxkit::vq {
namespace {

/// How 8 values of a width become 8 dwords: which bytes of 16, and how far they are shifted.
struct alignas(32) Unpacking {
  uint8_t bytes[32];
  uint32_t shift[8];
};
constexpr std::array<Unpacking, 17> unpackings = [] {
  std::array<Unpacking, 17> all{};
  for (int width = 0; width <= 16; ++width)
    for (int i = 0; i < 8; ++i) {
      Unpacking& u = all[static_cast<size_t>(width)];
      u.shift[i] = static_cast<uint32_t>(i * width % 8);
      for (int b = 0; b < 4; ++b) {
        const int byte = i * width / 8 + b;
        u.bytes[4 * i + b] = static_cast<uint8_t>(byte < 16 ? byte : 0x80);
      }
    }
  return all;
}();

/// All ones in the lanes of rows with y + z = k.
constexpr auto slopes = [] {
  struct alignas(32) Lanes {
    uint16_t lane[16];
  };
  std::array<Lanes, 7> all{};
  for (int y = 0; y < 4; ++y)
    for (int z = 0; z < 4; ++z) all[static_cast<size_t>(y + z)].lane[y + 4 * z] = 0xffff;
  return all;
}();

/// Where a face has the prediction of its own plane (`median_bounded`), the other two are made 0 and 65535,
/// which leaves that one in the middle. Of rows (y, z) at x = 0, and where x > 0.
struct alignas(32) FaceMasks {
  uint16_t no_xy[16], full_xz[16];
};
constexpr auto faces = [] {
  std::array<FaceMasks, 8> all{};
  for (int step = 0; step < 8; ++step)
    for (int y = 0; y < 4; ++y)
      for (int z = 1; z < 4; ++z) {
        FaceMasks& m = all[static_cast<size_t>(step)];
        const bool first = step == y + z;  // x = 0
        m.no_xy[y + 4 * z] = y == 0 || first ? 0xffff : 0;
        m.full_xz[y + 4 * z] = y != 0 && first ? 0xffff : 0;
      }
  return all;
}();

using Vector = __m256i;

VOXKIT_INLINE Vector unpack(const std::byte* bytes, int width) {
  const Unpacking& u = unpackings[static_cast<size_t>(width)];
  const Vector words = _mm256_broadcastsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes)));
  const Vector spread = _mm256_shuffle_epi8(words, *reinterpret_cast<const Vector*>(u.bytes));
  const Vector shifted = _mm256_srlv_epi32(spread, *reinterpret_cast<const Vector*>(u.shift));
  return _mm256_and_si256(shifted, _mm256_set1_epi32((1 << width) - 1));
}

/// All ones where a <= b, unsigned.
VOXKIT_INLINE Vector at_most(Vector a, Vector b) {
  return _mm256_cmpeq_epi16(_mm256_subs_epu16(a, b), _mm256_setzero_si256());
}
/// Each lane from the row below it in y, zero for y = 0.
VOXKIT_INLINE Vector below_y(Vector v) {
  return _mm256_slli_epi64(v, 16);
}
/// The same in z.
VOXKIT_INLINE Vector below_z(Vector v) {
  return _mm256_alignr_epi8(v, _mm256_permute2x128_si256(v, v, 0x08), 8);
}
VOXKIT_INLINE Vector slope(int k) {
  return *reinterpret_cast<const Vector*>(slopes[static_cast<size_t>(k)].lane);
}

/// a + b - ab, not below 0 nor above 65535; where `full` 65535 if ab <= a, where `none` 0.
VOXKIT_INLINE Vector plane_of(Vector a, Vector b, Vector ab, Vector full, Vector none) {
  const Vector up = _mm256_or_si256(_mm256_subs_epu16(a, ab), full);
  return _mm256_subs_epu16(_mm256_adds_epu16(b, up), _mm256_or_si256(_mm256_subs_epu16(ab, a), none));
}
/// Tops below this leave room for shorter ways.
constexpr uint32_t narrow_tops = 1 << 14;

/// a + b modulo top + 1.
template <bool narrow>
VOXKIT_INLINE Vector add_modulo(Vector a, Vector b, Vector top, Vector modulus) {
  // One of both is below modulus, the other one is not, or has wrapped around.
  if constexpr (narrow) {
    return _mm256_min_epu16(_mm256_add_epi16(a, b), _mm256_add_epi16(a, _mm256_sub_epi16(b, modulus)));
  } else {
    const Vector fits = at_most(b, _mm256_sub_epi16(top, a));
    return _mm256_sub_epi16(_mm256_add_epi16(a, b), _mm256_andnot_si256(fits, modulus));
  }
}
/// `unfold_bounded`. With p the prediction, or for odd codes, which count downwards, top - p and the result
/// likewise: p + (code + 1) / 2 if that is at most top, but where it is less than the code, the code; else
/// top - code.
VOXKIT_INLINE Vector unfold_narrow(Vector code, Vector predicted, Vector top, Vector modulus) {
  const Vector odd = _mm256_sub_epi16(_mm256_setzero_si256(), _mm256_and_si256(code, _mm256_set1_epi16(1)));
  const Vector turn = _mm256_and_si256(odd, modulus);  // (v ^ odd) + turn: v, or top - v
  const Vector distance = _mm256_add_epi16(_mm256_avg_epu16(code, _mm256_setzero_si256()), turn);
  const Vector near = _mm256_max_epi16(_mm256_add_epi16(_mm256_xor_si256(predicted, odd), distance), code);
  const Vector fits = _mm256_cmpgt_epi16(modulus, near);
  const Vector voxel = _mm256_min_epu16(near, _mm256_or_si256(_mm256_sub_epi16(top, code), fits));
  return _mm256_add_epi16(_mm256_xor_si256(voxel, odd), turn);
}
VOXKIT_INLINE Vector unfold_wide(Vector code, Vector predicted, Vector top) {
  const Vector room = _mm256_sub_epi16(top, predicted), low = at_most(predicted, room);
  const Vector near = _mm256_min_epu16(predicted, room);
  const Vector odd = _mm256_sub_epi16(_mm256_setzero_si256(), _mm256_and_si256(code, _mm256_set1_epi16(1)));
  const Vector both_sides = _mm256_add_epi16(predicted, _mm256_xor_si256(_mm256_srli_epi16(code, 1), odd));
  const Vector one_side = _mm256_blendv_epi8(_mm256_sub_epi16(top, code), code, low);
  return _mm256_blendv_epi8(one_side, both_sides, at_most(code, _mm256_add_epi16(near, near)));
}

/// Residuals of columns x = 0 .. 3, of the transforms with medians, become voxels. Rows that have not begun
/// are 0, as is what lies outside the brick: so are their codes, and their predictions.
template <bool bounded, bool narrow>
VOXKIT_INLINE void invert_medians(Vector* columns, Vector top, Vector modulus) {
  const Vector zero = _mm256_setzero_si256();
  const Vector no_xz = bounded ? _mm256_setr_epi64x(-1, 0, 0, 0) : zero;                   // z = 0
  const Vector full_yz = bounded ? _mm256_setr_epi64x(-1, 0xffff, 0xffff, 0xffff) : zero;  // or y = 0
  Vector steps[10], before = zero, before_b = zero, before_c = zero;
#pragma GCC unroll 10
  for (int t = 0; t < 10; ++t) {
    Vector code = zero;
#pragma GCC unroll 4
    for (int x = 0; x < 4; ++x)
      if (t - x >= 0 && t - x <= 6) code = _mm256_or_si256(code, _mm256_and_si256(columns[x], slope(t - x)));
    const FaceMasks& face = faces[static_cast<size_t>(t < 7 ? t : 7)];
    const Vector no_xy = bounded ? *reinterpret_cast<const Vector*>(face.no_xy) : zero;
    const Vector full_xz = bounded ? *reinterpret_cast<const Vector*>(face.full_xz) : zero;
    const Vector a = before, b = below_y(a), c = below_z(a);
    const Vector ab = before_b, ac = before_c, bc = below_y(before_c);
    const Vector xy = plane_of(a, b, ab, zero, no_xy);
    const Vector xz = plane_of(a, c, ac, full_xz, no_xz), yz = plane_of(b, c, bc, full_yz, zero);
    const Vector low = _mm256_min_epu16(xy, xz), high = _mm256_max_epu16(xy, xz);
    const Vector median = _mm256_max_epu16(low, _mm256_min_epu16(high, yz));
    const Vector predicted = _mm256_min_epu16(median, top);
    if constexpr (!bounded) {
      before = add_modulo<narrow>(predicted, code, top, modulus);
    } else if constexpr (narrow) {
      before = unfold_narrow(code, predicted, top, modulus);
    } else {
      before = unfold_wide(code, predicted, top);
    }
    steps[t] = before;
    before_b = b;
    before_c = c;
  }
#pragma GCC unroll 4
  for (int x = 0; x < 4; ++x) {
    Vector column = zero;
#pragma GCC unroll 7
    for (int k = 0; k < 7; ++k) column = _mm256_or_si256(column, _mm256_and_si256(steps[x + k], slope(k)));
    columns[x] = column;
  }
}

/// Of the transform `previous`: sums along z where x = y = 0, then along y where x = 0, then along x.
template <bool narrow>
VOXKIT_INLINE void invert_previous(Vector* columns, Vector top, Vector modulus) {
  const Vector bottom = _mm256_set1_epi64x(0xffff);
  Vector edge = _mm256_and_si256(columns[0], bottom);
  edge = add_modulo<narrow>(edge, below_z(edge), top, modulus);
  edge = add_modulo<narrow>(edge, _mm256_permute2x128_si256(edge, edge, 0x08), top, modulus);
  Vector face = _mm256_blendv_epi8(columns[0], edge, bottom);
  face = add_modulo<narrow>(face, below_y(face), top, modulus);
  face = add_modulo<narrow>(face, _mm256_slli_epi64(face, 32), top, modulus);
  columns[0] = face;
  for (int x = 1; x < 4; ++x) columns[x] = add_modulo<narrow>(columns[x - 1], columns[x], top, modulus);
}

/// The upward distances that codes folded modulo stand for.
VOXKIT_INLINE Vector upward(Vector code, Vector top) {
  const Vector half = _mm256_srli_epi16(code, 1);
  const Vector odd = _mm256_sub_epi16(_mm256_setzero_si256(), _mm256_and_si256(code, _mm256_set1_epi16(1)));
  return _mm256_blendv_epi8(half, _mm256_sub_epi16(top, half), odd);
}

/// Residuals of columns become voxels, less the least one.
template <bool narrow>
VOXKIT_INLINE void invert_columns(Transform transform, Vector* columns, Vector top, Vector modulus) {
  switch (transform) {
    case Transform::none:
      break;
    case Transform::previous:
      for (int x = 0; x < 4; ++x) columns[x] = upward(columns[x], top);
      return invert_previous<narrow>(columns, top, modulus);
    case Transform::median_modulo:
      for (int x = 0; x < 4; ++x) columns[x] = upward(columns[x], top);
      return invert_medians<false, narrow>(columns, top, modulus);
    case Transform::median_bounded:
      return invert_medians<true, narrow>(columns, top, modulus);
  }
}

/// Octants as `unpack` makes them become columns.
VOXKIT_INLINE void columns_of(const Vector* octants, Vector* columns) {
  // Along x in an octant, then across: dwords of two voxels along y.
  const Vector order =
      _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 4, 5, 2, 3, 6, 7, 8, 9, 12, 13, 10, 11, 14, 15));
  Vector q[4];
  for (int i = 0; i < 4; ++i)
    q[i] = _mm256_shuffle_epi8(_mm256_packus_epi32(octants[2 * i], octants[2 * i + 1]), order);
  const Vector low0 = _mm256_unpacklo_epi32(q[0], q[1]), low1 = _mm256_unpacklo_epi32(q[2], q[3]);
  const Vector high0 = _mm256_unpackhi_epi32(q[0], q[1]), high1 = _mm256_unpackhi_epi32(q[2], q[3]);
  columns[0] = _mm256_permute4x64_epi64(_mm256_unpacklo_epi64(low0, low1), 0xd8);
  columns[1] = _mm256_permute4x64_epi64(_mm256_unpackhi_epi64(low0, low1), 0xd8);
  columns[2] = _mm256_permute4x64_epi64(_mm256_unpacklo_epi64(high0, high1), 0xd8);
  columns[3] = _mm256_permute4x64_epi64(_mm256_unpackhi_epi64(high0, high1), 0xd8);
}

/// Columns to raster order, `min` added.
VOXKIT_INLINE void store_columns(const Vector* columns, Vector min, uint16_t* voxels) {
  const Vector a = _mm256_add_epi16(columns[0], min), b = _mm256_add_epi16(columns[1], min),
               c = _mm256_add_epi16(columns[2], min), d = _mm256_add_epi16(columns[3], min);
  const Vector even0 = _mm256_unpacklo_epi16(a, b), even1 = _mm256_unpacklo_epi16(c, d);
  const Vector odd0 = _mm256_unpackhi_epi16(a, b), odd1 = _mm256_unpackhi_epi16(c, d);
  const Vector e = _mm256_unpacklo_epi32(even0, even1), f = _mm256_unpackhi_epi32(even0, even1);
  const Vector g = _mm256_unpacklo_epi32(odd0, odd1), h = _mm256_unpackhi_epi32(odd0, odd1);
  auto* const out = reinterpret_cast<Vector*>(voxels);
  _mm256_storeu_si256(out, _mm256_permute2x128_si256(e, f, 0x20));
  _mm256_storeu_si256(out + 1, _mm256_permute2x128_si256(g, h, 0x20));
  _mm256_storeu_si256(out + 2, _mm256_permute2x128_si256(e, f, 0x31));
  _mm256_storeu_si256(out + 3, _mm256_permute2x128_si256(g, h, 0x31));
}

}  // namespace

VOXKIT_AVX2_CODE bool decode_plain_avx2(const std::byte* bytes, int bits, BrickRange range,
                                        uint16_t* voxels) {
  const Vector min = _mm256_set1_epi16(static_cast<short>(range.min)),
               max = _mm256_set1_epi16(static_cast<short>(range.max));
  Vector outside = _mm256_setzero_si256();
  for (int i = 0; i < 4; ++i) {
    const Vector packed =
        _mm256_packus_epi32(unpack(bytes + 2 * i * bits, bits), unpack(bytes + (2 * i + 1) * bits, bits));
    const Vector v = _mm256_permute4x64_epi64(packed, 0xd8);
    outside = _mm256_or_si256(outside, _mm256_or_si256(_mm256_subs_epu16(v, max), _mm256_subs_epu16(min, v)));
    _mm256_storeu_si256(reinterpret_cast<Vector*>(voxels) + i, v);
  }
  return _mm256_testz_si256(outside, outside);
}

VOXKIT_AVX2_CODE bool decode_codeword_avx2(const std::byte* codeword, uint32_t available, int bits,
                                           BrickRange range, uint16_t* voxels) {
  const auto head = static_cast<uint32_t>(codeword[0]);
  if (head == escape)
    return available > static_cast<uint32_t>(plain_bytes(bits)) &&
           decode_plain_avx2(codeword + 1, bits, range, voxels);
  const uint32_t c2 = head & 63;
  if (c2 > 5) return false;
  uint64_t widths = load_le<uint64_t>(codeword + 1);
  const uint64_t mask = (uint64_t{1} << c2) - 1;
  uint32_t at = 1 + c2;
  Vector octants[8], columns[4];
  for (Vector& octant : octants) {
    const auto c1 = static_cast<uint32_t>(widths & mask);
    widths >>= c2;
    if (c1 > 16 || at + c1 > available) return false;
    octant = unpack(codeword + at, static_cast<int>(c1));
    at += c1;
  }
  columns_of(octants, columns);
  const Vector top = _mm256_set1_epi16(static_cast<short>(range.max - range.min));
  const Vector modulus = _mm256_add_epi16(top, _mm256_set1_epi16(1));
  const Vector largest =
      _mm256_max_epu16(_mm256_max_epu16(columns[0], columns[1]), _mm256_max_epu16(columns[2], columns[3]));
  const Vector over = _mm256_subs_epu16(largest, top);
  if (!_mm256_testz_si256(over, over)) return false;
  const auto transform = static_cast<Transform>(head >> 6);
  if (static_cast<uint32_t>(range.max - range.min) < narrow_tops) {
    invert_columns<true>(transform, columns, top, modulus);
  } else {
    invert_columns<false>(transform, columns, top, modulus);
  }
  store_columns(columns, _mm256_set1_epi16(static_cast<short>(range.min)), voxels);
  return true;
}

}  // namespace voxkit::vq

#endif
