// Samples side by side in vector registers, each lane a ray: what GCC's and Clang's vector extension has no
// operator for. All of it gives the same bits on every machine, and those of dvr_lane.h.
#pragma once

#include <cstddef>
#include <cstring>
#include <type_traits>

#include "librender/dvr/dvr_lane.h"

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(VOXKIT_SCALAR)
#define VOXKIT_DVR_AVX2
#include <immintrin.h>
#endif

namespace voxkit::render {

/// Vectors of as many lanes.
template <int count>
struct Vectors;
template <>
struct Vectors<8> {
  typedef float Real __attribute__((vector_size(32)));
  typedef int32_t Int __attribute__((vector_size(32)));
};
template <>
struct Vectors<32> {
  typedef float Real __attribute__((vector_size(128)));
  typedef int32_t Int __attribute__((vector_size(128)));
};

/// Rays through `wide` x `high` neighbouring pixels, for any machine.
template <int wide, int high>
struct VectorLanes : OneLane {
  static constexpr int width = wide, height = high, count = wide * high;
  static constexpr int held = count;  ///< lanes of this thread, `first()` being the first one
  VOX_HD_HOT static constexpr int first() { return 0; }
  using Real = typename Vectors<count>::Real;
  using Int = typename Vectors<count>::Int;
  using Mask = Int;  ///< -1 where the condition holds, else 0

  using OneLane::all, OneLane::least, OneLane::greatest, OneLane::root;
  using OneLane::to_float, OneLane::to_int, OneLane::bits_as_float, OneLane::float_as_bits;
  VOX_HD_HOT static Real all(float x) { return x - Real{}; }
  VOX_HD_HOT static Int all(int32_t x) { return x - Int{}; }
  VOX_HD_HOT static Real least(const Real& a, const Real& b) { return a < b ? a : b; }
  VOX_HD_HOT static Real greatest(const Real& a, const Real& b) { return a > b ? a : b; }
  VOX_HD_HOT static Real root(const Real& x) {
    Real y;
    for (int i = 0; i < count; ++i) y[i] = std::sqrt(x[i]);
    return y;
  }
  VOX_HD_HOT static Real to_float(const Int& x) { return __builtin_convertvector(x, Real); }
  VOX_HD_HOT static Int to_int(const Real& x) { return __builtin_convertvector(x, Int); }
  VOX_HD_HOT static Real bits_as_float(const Int& x) { return reinterpret_cast<Real>(x); }
  VOX_HD_HOT static Int float_as_bits(const Real& x) { return reinterpret_cast<Int>(x); }

  template <class Value>
  VOX_HD_HOT static auto load(const Value (&values)[count]) {
    std::conditional_t<std::is_same_v<Value, float>, Real, Int> x;
    std::memcpy(&x, values, sizeof x);
    return x;
  }
  /// A lane that this thread holds.
  template <class Vector>
  VOX_HD_HOT static auto get(const Vector& x, int lane) {
    return x[lane];
  }
  template <class Vector, class Value>
  VOX_HD_HOT static void set(Vector& x, int lane, Value value) {
    x[lane] = value;
  }
  /// What one lane has, for all of them.
  template <class Vector>
  VOX_HD_HOT static auto broadcast(const Vector& x, int lane) {
    return x[lane];
  }
  /// Waits until all lanes have come here, and see what the others wrote.
  VOX_HD_HOT static void sync() {}
  /// Bit i: whether the condition holds in lane i.
  VOX_HD_HOT static uint32_t bits(const Mask& condition) {
    uint32_t set = 0;
    for (int i = 0; i < count; ++i) set |= static_cast<uint32_t>(condition[i] < 0) << i;
    return set;
  }
  /// The least of all lanes.
  VOX_HD_HOT static int32_t least_lane(const Int& x) {
    if constexpr (count == 8) {
      const Int a = lesser(x, exchanged<4>(x)), b = lesser(a, exchanged<2>(a));
      return lesser(b, exchanged<1>(b))[0];
    }
    int32_t found = x[0];
    for (int i = 1; i < count; ++i) found = x[i] < found ? x[i] : found;
    return found;
  }
  /// What the lane beside each in a row of two has, and that below or above it in a column of two.
  template <class Vector>
  VOX_HD_HOT static Vector beside(const Vector& x) {
    return exchanged<1>(x);
  }
  template <class Vector>
  VOX_HD_HOT static Vector below(const Vector& x) {
    return exchanged<wide>(x);
  }

  /// Values at a place of each lane, and at the next one; 0 where a lane is not wanted. T is uint8_t,
  /// uint16_t or float. Reads 4 bytes from the first one's.
  template <class T>
  VOX_HD_HOT static void gather_pair(const T* base, const Int& at, const Mask& wanted, Real& a, Real& b) {
    for (int i = 0; i < count; ++i) {
      a[i] = wanted[i] ? static_cast<float>(base[at[i]]) : 0;
      b[i] = wanted[i] ? static_cast<float>(base[at[i] + 1]) : 0;
    }
  }
  VOX_HD_HOT static Real gather(const float* base, const Int& at, const Mask& wanted) {
    Real found;
    for (int i = 0; i < count; ++i) found[i] = wanted[i] ? base[at[i]] : 0;
    return found;
  }
  /// Reads 4 bytes.
  VOX_HD_HOT static Int gather(const uint8_t* base, const Int& at, const Mask& wanted) {
    Int found;
    for (int i = 0; i < count; ++i) found[i] = wanted[i] ? base[at[i]] : 0;
    return found;
  }

 private:
  VOX_HD_HOT static Int lesser(const Int& a, const Int& b) { return a < b ? a : b; }
  template <int bit, class Vector>
  VOX_HD_HOT static Vector exchanged(const Vector& x) {
    if constexpr (count == 8 && bit == 1) return __builtin_shufflevector(x, x, 1, 0, 3, 2, 5, 4, 7, 6);
    if constexpr (count == 8 && bit == 2) return __builtin_shufflevector(x, x, 2, 3, 0, 1, 6, 7, 4, 5);
    if constexpr (count == 8 && bit == 4) return __builtin_shufflevector(x, x, 4, 5, 6, 7, 0, 1, 2, 3);
    Vector y;
    for (int i = 0; i < count; ++i) y[i] = x[i ^ bit];
    return y;
  }
};

/// The packets of the host's renderer.
using PortableLanes = VectorLanes<4, 2>;
using Floats = PortableLanes::Real;
using Ints = PortableLanes::Int;

#ifdef VOXKIT_DVR_AVX2
/// The same for machines with AVX2; to be used in functions that are compiled for it.
struct Avx2Lanes : PortableLanes {
  using PortableLanes::gather, PortableLanes::greatest, PortableLanes::least, PortableLanes::root;
  VOX_HD_HOT static Floats least(const Floats& a, const Floats& b) { return __builtin_ia32_minps256(a, b); }
  VOX_HD_HOT static Floats greatest(const Floats& a, const Floats& b) {
    return __builtin_ia32_maxps256(a, b);
  }
  VOX_HD_HOT static Floats root(const Floats& x) { return __builtin_ia32_sqrtps256(x); }
  VOX_HD_HOT static uint32_t bits(const Ints& condition) {
    return static_cast<uint32_t>(__builtin_ia32_movmskps256(reinterpret_cast<Floats>(condition)));
  }
  template <class T>
  VOX_HD_HOT static void gather_pair(const T* base, const Ints& at, const Ints& wanted, Floats& a,
                                     Floats& b) {
    if constexpr (sizeof(T) == 4) {
      a = gather(base, at, wanted), b = gather(base + 1, at, wanted);
    } else {
      constexpr int bits_each = 8 * sizeof(T);
      const Ints pair = words<sizeof(T)>(base, at, wanted);
      a = to_float(pair & ((1 << bits_each) - 1));
      b = to_float((pair >> bits_each) & ((1 << bits_each) - 1));
    }
  }
  VOX_HD_HOT static Floats gather(const float* base, const Ints& at, const Ints& wanted) {
    return bits_as_float(words<4>(base, at, wanted));
  }
  VOX_HD_HOT static Ints gather(const uint8_t* base, const Ints& at, const Ints& wanted) {
    return words<1>(base, at, wanted) & 255;
  }

 private:
  template <int scale>
  VOX_HD_HOT static Ints words(const void* base, const Ints& at, const Ints& wanted) {
    return reinterpret_cast<Ints>(
        __builtin_ia32_gathersiv8si(Ints{}, static_cast<const int*>(base), at, wanted, scale));
  }
};
#else
using Avx2Lanes = PortableLanes;
#endif

}  // namespace voxkit::render
