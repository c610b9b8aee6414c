// Numbers of 113 bits, in which differences and products of floats are exact, and sums nearly always.
#pragma once

namespace voxkit::stress {

#if __LDBL_MANT_DIG__ >= 113
using Exact = long double;
#else
using Exact = __float128;
#endif

inline Exact magnitude(Exact x) {
  return x < 0 ? -x : x;
}
inline double to_double(Exact x) {
  return static_cast<double>(x);
}
/// The root, to twice the bits of a double's; 0 of what is below.
inline Exact root(Exact x) {
  if (!(x > 0) || x - x != 0) return x > 0 ? x : 0;
  // Newton's method, from the root of what a double can hold.
  Exact scale = 1;
  while (x > Exact(0x1p900)) x = x * 0x1p-200 * 0x1p-200, scale *= 0x1p200;
  while (x < Exact(0x1p-900)) x = x * 0x1p200 * 0x1p200, scale *= 0x1p-200;
  Exact r = __builtin_sqrt(static_cast<double>(x));
  for (int i = 0; i < 2; ++i) r = (r + x / r) / 2;
  return r * scale;
}

}  // namespace voxkit::stress
