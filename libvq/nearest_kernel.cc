#include "libvq/nearest_kernel.h"

#include "libvq/nearest_kernel_x86.h"

namespace voxkit::vq {
namespace {
namespace portable {

#define VOXKIT_CODE
constexpr size_t lanes = 4;
using Vector = std::array<uint32_t, lanes>;

template <class T>
inline Vector load(const T* from) {
  Vector v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
template <class T>
inline Vector fill(T number) {
  Vector v;
  v.fill(static_cast<uint32_t>(number));
  return v;
}
inline Vector add(Vector a, const Vector& b) {
  for (size_t i = 0; i < lanes; ++i) a[i] += b[i];
  return a;
}
inline Vector subtract(Vector a, const Vector& b) {
  for (size_t i = 0; i < lanes; ++i) a[i] -= b[i];
  return a;
}
inline int low(uint32_t pair) {
  return static_cast<int16_t>(pair);
}
inline int high(uint32_t pair) {
  return static_cast<int16_t>(pair >> 16);
}
inline uint32_t pair_of(int low, int high) {
  return static_cast<uint16_t>(low) | static_cast<uint32_t>(static_cast<uint16_t>(high)) << 16;
}
inline Vector add_products(Vector to, const Vector& a, const Vector& b) {
  for (size_t i = 0; i < lanes; ++i)
    to[i] += static_cast<uint32_t>(low(a[i]) * low(b[i])) + static_cast<uint32_t>(high(a[i]) * high(b[i]));
  return to;
}
inline Vector difference(Vector a, const Vector& b) {
  for (size_t i = 0; i < lanes; ++i) a[i] = pair_of(low(a[i]) - low(b[i]), high(a[i]) - high(b[i]));
  return a;
}
inline int outside(int x, int least, int most) {
  return x < least ? least - x : x > most ? x - most : 0;
}
inline Vector gap(Vector x, const Vector& least, const Vector& most) {
  for (size_t i = 0; i < lanes; ++i)
    x[i] = pair_of(outside(low(x[i]), low(least[i]), low(most[i])),
                   outside(high(x[i]), high(least[i]), high(most[i])));
  return x;
}
inline uint32_t sign_mask(const Vector& v) {
  uint32_t mask = 0;
  for (size_t i = 0; i < lanes; ++i) mask |= v[i] >> 31 << i;
  return mask;
}
template <class T>
inline void compress(uint32_t mask, const Vector& v, T* to) {
  for (size_t i = 0; i < lanes; ++i)
    if (mask >> i & 1) *to++ = static_cast<T>(v[i]);
}
inline uint32_t sum(const Vector& v) {
  return v[0] + v[1] + v[2] + v[3];
}

#include "libvq/nearest_kernel_body.h"

}  // namespace portable
}  // namespace

void QueryRows::make_room(size_t count) {
  if (number.size() >= count + leaf_bricks) return;  // at least a vector of any machine
  count = count + count / 2 + leaf_bricks;
  for (std::vector<int32_t>& row : pairs) row.resize(count);
  reach.resize(count);
  number.resize(count);
}

QueryKey query_key(const Key& key, const Brick& brick, int32_t reach) {
  QueryKey query;
  std::array<int16_t, fine_axes> doubled;
  for (size_t a = 0; a < fine_axes; ++a) doubled[a] = static_cast<int16_t>(-2 * key.fine[a]);
  for (int j = 0; j < fine_pairs; ++j) query.doubled[static_cast<size_t>(j)] = key_pair(doubled, j);
  query.edge = key.norm - static_cast<uint32_t>(reach);
  query.brick = &brick;
  return query;
}

const Kernels& search_kernels([[maybe_unused]] bool native, bool narrow) {
#ifdef VOXKIT_AVX2
  if (native && has_avx512()) return avx512_kernels(narrow);
  if (native && has_avx2()) return avx2_kernels(narrow);
#endif
  return narrow ? portable::narrow_kernels : portable::wide_kernels;
}

}  // namespace voxkit::vq
