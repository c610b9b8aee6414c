// What this machine does at best, measured: what kernels and programs are held against.
#pragma once

#include <cstddef>

namespace voxkit::bench {

/// Cycles a second that a thread has now: additions that wait for each other take one each.
double clock_hz();

/// Bytes a second that `threads` threads read together, each from memory of its own of `bytes` bytes; the
/// best of some rounds.
double read_bytes_per_s(int threads, size_t bytes);
/// The same for memcpy; bytes read and bytes written are counted.
double copy_bytes_per_s(int threads, size_t bytes);
/// For arrays that no cache holds.
inline constexpr size_t beyond_caches = size_t{256} << 20;

/// Nanoseconds for a load from any cache line of `bytes` bytes, where the processor knows many places in
/// advance. Measured once for sizes that are nearly the same.
double scattered_load_ns(size_t bytes);

/// The same where each load says where the next one is.
double chained_load_ns(size_t bytes);

/// Additions and multiplications of doubles a second, one thread, in vectors as wide as AVX2's where that is.
double double_operations_per_s();

}  // namespace voxkit::bench
