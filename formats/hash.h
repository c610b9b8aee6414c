// Counter-based random numbers: any element of a random field, in any order.
#pragma once

#include <cstdint>

namespace voxkit {

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014): a bijection in which every bit of the input
/// moves every bit of the output.
constexpr uint64_t mix64(uint64_t v) {
  v = (v ^ (v >> 30)) * 0xbf58476d1ce4e5b9u;
  v = (v ^ (v >> 27)) * 0x94d049bb133111ebu;
  return v ^ (v >> 31);
}
/// Number `index` of the SplitMix64 sequence that starts at `key`.
constexpr uint64_t random64(uint64_t key, uint64_t index) {
  return mix64(key + (index + 1) * 0x9e3779b97f4a7c15u);
}

}  // namespace voxkit
