// Which machines have code of their own: the one place that decides. All code gives the same results; with
// VOXKIT_SCALAR (the preset of that name), and on other machines than x86-64, there is only that for any
// machine.
#pragma once

#if defined(__x86_64__) && !defined(VOXKIT_SCALAR)
/// There is code for AVX2 and for AVX-512: functions that begin with one of these, to be called where
/// has_avx2() and has_avx512() say so. What they call is part of them, or has the same mark.
#define VOXKIT_AVX2
#define VOXKIT_AVX2_CODE [[gnu::target("avx2,bmi,bmi2,lzcnt,popcnt,fma")]]
#define VOXKIT_AVX512_CODE [[gnu::target("avx512f,avx512bw,avx512dq,avx512vnni,bmi,bmi2,lzcnt,popcnt,fma")]]
#endif

namespace voxkit {

/// Whether VOXKIT_AVX2_CODE may run here; false where there is none.
inline bool has_avx2() {
#ifdef VOXKIT_AVX2
  // And with these lzcnt, which Clang 14 cannot ask for.
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2") &&
         __builtin_cpu_supports("popcnt") && __builtin_cpu_supports("fma");
#else
  return false;
#endif
}

/// Whether VOXKIT_AVX512_CODE may run here; false where there is none.
inline bool has_avx512() {
#ifdef VOXKIT_AVX2
  return has_avx2() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vnni");
#else
  return false;
#endif
}

}  // namespace voxkit
