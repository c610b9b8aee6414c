// Eight samples side by side in vector registers: the few operations that GCC's and Clang's vector extension
// has no operator for. All of them give the same bits on every machine.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "formats/hd.h"

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(VOXKIT_SCALAR)
#define VOXKIT_DVR_AVX2
#include <immintrin.h>
#endif

namespace voxkit::render {

constexpr int dvr_lanes = 8;
typedef float Floats __attribute__((vector_size(32)));
typedef int32_t Ints __attribute__((vector_size(32)));

VOX_HD_HOT Floats all(float x) {
  return Floats{x, x, x, x, x, x, x, x};
}
VOX_HD_HOT Ints all(int32_t x) {
  return Ints{x, x, x, x, x, x, x, x};
}
VOX_HD_HOT int32_t least_lane(const Ints& x) {
  int32_t least = x[0];
  for (int i = 1; i < dvr_lanes; ++i) least = x[i] < least ? x[i] : least;
  return least;
}
VOX_HD_HOT Floats to_float(const Ints& x) {
  return __builtin_convertvector(x, Floats);
}
/// Towards zero; |x| < 2^31.
VOX_HD_HOT Ints to_int(const Floats& x) {
  return __builtin_convertvector(x, Ints);
}
VOX_HD_HOT float to_float(int32_t x) {
  return static_cast<float>(x);
}
VOX_HD_HOT int32_t to_int(float x) {
  return static_cast<int32_t>(x);
}
VOX_HD_HOT Floats bits_as_float(const Ints& x) {
  return reinterpret_cast<Floats>(x);
}
VOX_HD_HOT float bits_as_float(int32_t x) {
  return __builtin_bit_cast(float, x);
}
VOX_HD_HOT Ints float_as_bits(const Floats& x) {
  return reinterpret_cast<Ints>(x);
}
VOX_HD_HOT int32_t float_as_bits(float x) {
  return __builtin_bit_cast(int32_t, x);
}

/// For any machine.
struct PortableLanes {
  template <class Real>
  VOX_HD_HOT static Real least(const Real& a, const Real& b) {
    return a < b ? a : b;
  }
  template <class Real>
  VOX_HD_HOT static Real greatest(const Real& a, const Real& b) {
    return a > b ? a : b;
  }
  VOX_HD_HOT static float root(float x) { return std::sqrt(x); }
  VOX_HD_HOT static Floats root(const Floats& x) {
    Floats y;
    for (int i = 0; i < dvr_lanes; ++i) y[i] = std::sqrt(x[i]);
    return y;
  }
  /// Bit i: whether the condition holds in lane i.
  VOX_HD_HOT static unsigned bits(const Ints& condition) {
    unsigned set = 0;
    for (int i = 0; i < dvr_lanes; ++i) set |= static_cast<unsigned>(condition[i] < 0) << i;
    return set;
  }
  /// The 32 bits at base + scale * at of each lane, unaligned; at < 0 where a lane is not wanted: 0.
  template <int scale>
  VOX_HD_HOT static Ints gather(const void* base, const Ints& at) {
    Ints found{};
    for (int i = 0; i < dvr_lanes; ++i) {
      int32_t word = 0;
      if (at[i] >= 0)
        std::memcpy(&word, static_cast<const std::byte*>(base) + static_cast<int64_t>(at[i]) * scale, 4);
      found[i] = word;
    }
    return found;
  }
};

#ifdef VOXKIT_DVR_AVX2
/// For machines with AVX2; to be used in functions that are compiled for it.
struct Avx2Lanes {
  VOX_HD_HOT static Floats least(const Floats& a, const Floats& b) { return __builtin_ia32_minps256(a, b); }
  VOX_HD_HOT static Floats greatest(const Floats& a, const Floats& b) {
    return __builtin_ia32_maxps256(a, b);
  }
  VOX_HD_HOT static Floats root(const Floats& x) { return __builtin_ia32_sqrtps256(x); }
  VOX_HD_HOT static unsigned bits(const Ints& condition) {
    return static_cast<unsigned>(__builtin_ia32_movmskps256(reinterpret_cast<Floats>(condition)));
  }
  template <int scale>
  VOX_HD_HOT static Ints gather(const void* base, const Ints& at) {
    return reinterpret_cast<Ints>(
        __builtin_ia32_gathersiv8si(reinterpret_cast<__v8si>(Ints{}), static_cast<const int*>(base),
                                    reinterpret_cast<__v8si>(at), reinterpret_cast<__v8si>(~at), scale));
  }
};
#else
using Avx2Lanes = PortableLanes;
#endif

}  // namespace voxkit::render
