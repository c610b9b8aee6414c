// Which machines have code of their own.
#pragma once

#if defined(__x86_64__) && !defined(VOXKIT_SCALAR)
#define VOXKIT_AVX2
#endif

namespace voxkit {

/// Whether code for AVX2 may run here; false where there is none.
inline bool has_avx2() {
#ifdef VOXKIT_AVX2
  return __builtin_cpu_supports("avx2");
#else
  return false;
#endif
}

}  // namespace voxkit
