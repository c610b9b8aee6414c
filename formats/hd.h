// Code for host and device: functions marked VOX_HD use no allocation, no exceptions and no standard
// containers, and give the same results on both.
#pragma once

#ifdef __CUDACC__
#define VOX_HD __host__ __device__
#else
#define VOX_HD
#endif
/// Inner loops are compiled as a whole: what they call is part of them (and of the instruction set that they
/// are compiled for), but for what is seldom needed, which must not take their registers.
#ifdef __CUDACC__
#define VOX_HD_HOT VOX_HD __forceinline__
#define VOX_HD_COLD VOX_HD __noinline__
#else
#define VOX_HD_HOT [[gnu::always_inline]] inline
#define VOX_HD_COLD [[gnu::noinline, gnu::cold]]
#endif
