// Opacity over a length, from arithmetic alone: the same bits on every host, compiler and device.
#pragma once

#include <bit>
#include <cstdint>

#include "formats/hd.h"

namespace voxkit::render {

/// log2 of 0 < x < 1, normal; relative error below 1e-13.
VOX_HD inline double log2_of_fraction(double x) {
  const auto bits = std::bit_cast<uint64_t>(x);
  int exponent = static_cast<int>(bits >> 52) - 1023;
  double m = std::bit_cast<double>((bits & 0x000fffffffffffff) | 0x3ff0000000000000);
  if (m > 1.4142135623730951) m *= 0.5, ++exponent;
  // ln m = 2 artanh(s), |s| < 0.1716
  const double s = (m - 1) / (m + 1), q = s * s;
  double sum = 1.0 / 19;
  for (int k = 17; k >= 1; k -= 2) sum = sum * q + 1.0 / k;
  return exponent + 2.8853900817779268 * s * sum;  // 2 / ln 2
}

/// 2^x of x <= 0; relative error below 1e-14, 0 below 2^-1000.
VOX_HD inline double exp2_of_negative(double x) {
  if (!(x > -1000)) return 0;
  const int whole = static_cast<int>(x - 0.5);
  const double y = (x - whole) * 0.6931471805599453;  // |y| < 0.35
  double sum = 1;
  for (int k = 13; k >= 1; --k) sum = 1 + sum * y * (1.0 / k);
  return sum * std::bit_cast<double>(static_cast<uint64_t>(whole + 1023) << 52);
}

/// What a length of n voxels of opacity a covers: 1 - (1 - a)^n, for 0 < a <= 1 and n >= 0. So neither
/// skipping nor levels of detail change what is seen.
VOX_HD inline double coverage(double a, double n) {
  return a >= 1 ? 1 : 1 - exp2_of_negative(n * log2_of_fraction(1 - a));
}

}  // namespace voxkit::render
