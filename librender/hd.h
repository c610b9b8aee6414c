// Code for host and device: functions marked VOX_HD use no allocation, no exceptions and no standard
// containers.
#pragma once

#ifdef __CUDACC__
#define VOX_HD __host__ __device__
#else
#define VOX_HD
#endif
