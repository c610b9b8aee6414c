// Nodes of a DAG in which subtrees that are mirror images of each other are stored once, as well as equal
// ones. Source: A. J. Villanueva, F. Marton, E. Gobbetti, "SSVDAGs: Symmetry-aware Sparse Voxel DAGs", I3D
// 2016; counts of colours, leaves within nodes and sizes of pointers are ours. File: formats/FORMAT.md,
// section 4.10.
//
// A pointer leads to a subtree that is to be mirrored along some axes: x, y and z are bits 0 to 2 of
// `mirror`. In memory it is 32 bits, the mirror on top; in a node
//
//   2 bytes       for each octant two bits, its code: 0: nothing is in it; 1, 2: a pointer of 2 or of 3
//   bytes;
//                 3: one of 4 bytes, or above leaf words the word itself
//   1 to 10 bytes how many colours there are below, 7 bits a byte, the lowest first; bit 7: more follow
//   then          the pointers of octants, in order, and then the words
//
// A pointer has the mirror in its lowest three bits; above it is the number of a leaf word, or of the first
// byte of a node among those of its height. A word in a node is a byte that says which octants of it hold
// voxels, and a byte for each of these.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

#include "formats/hd.h"
#include "libcolor/dag/dag.h"

namespace voxkit::color {

inline constexpr uint32_t mirror_shift = 29, address_mask = (1u << mirror_shift) - 1;
/// Of the address of a leaf word: it is in a node, at a byte of those of the height above.
inline constexpr uint32_t word_in_node = 1u << 28;
/// Codes of octants: a pointer of 3 bytes; one of 4, or a word.
inline constexpr uint32_t code_long = 2, code_other = 3;

/// Exchanges the bits of `low` with those that many places above them, if asked to; without a branch, as it
/// is as good as chance.
template <class Word>
VOX_HD constexpr Word exchanged(Word word, Word low, int by, uint32_t whether) {
  const Word apart = (word >> by ^ word) & low & (Word{0} - Word{whether});
  return word ^ apart ^ apart << by;
}
/// A mask of octants, mirrored.
VOX_HD constexpr uint32_t mirrored_octants(uint32_t mask, uint32_t mirror) {
  mask = exchanged(mask, 0x55u, 1, mirror & 1);
  mask = exchanged(mask, 0x33u, 2, mirror >> 1 & 1);
  return exchanged(mask, 0x0fu, 4, mirror >> 2 & 1);
}
/// A leaf word, mirrored: both bits of each coordinate of its voxels change.
VOX_HD constexpr uint64_t mirrored_word(uint64_t word, uint32_t mirror) {
  word = exchanged(word, uint64_t{0x5555555555555555u}, 1, mirror & 1);
  word = exchanged(word, uint64_t{0x00ff00ff00ff00ffu}, 8, mirror & 1);
  word = exchanged(word, uint64_t{0x3333333333333333u}, 2, mirror >> 1 & 1);
  word = exchanged(word, uint64_t{0x0000ffff0000ffffu}, 16, mirror >> 1 & 1);
  word = exchanged(word, uint64_t{0x0f0f0f0f0f0f0f0fu}, 4, mirror >> 2 & 1);
  return exchanged(word, uint64_t{0x00000000ffffffffu}, 32, mirror >> 2 & 1);
}

/// What pointers of these codes take in bytes: one more than its code each, where it is not 0.
VOX_HD constexpr uint32_t pointer_bytes_of(uint32_t codes) {
  const auto sum = [](uint32_t pairs) {  // of eight numbers of two bits
    pairs = (pairs & 0x3333) + (pairs >> 2 & 0x3333);
    pairs = (pairs & 0x0f0f) + (pairs >> 4 & 0x0f0f);
    return (pairs + (pairs >> 8)) & 0xff;
  };
  return sum(codes) + sum((codes | codes >> 1) & 0x5555);
}

/// For each octant a byte: how many bytes of pointers of these codes come before its own.
VOX_HD constexpr uint64_t pointer_starts(uint32_t codes) {
  uint64_t bytes = codes;  // a byte for each code
  bytes = (bytes | bytes << 24) & 0x000000ff000000ffu;
  bytes = (bytes | bytes << 12) & 0x000f000f000f000fu;
  bytes = (bytes | bytes << 6) & 0x0303030303030303u;
  bytes += (bytes | bytes >> 1) & 0x0101010101010101u;
  return bytes * 0x0101010101010100u;
}

/// Octants whose code is not 0.
VOX_HD constexpr uint32_t octants_of_codes(uint32_t codes) {
  uint32_t mask = (codes | codes >> 1) & 0x5555;
  mask = (mask | mask >> 1) & 0x3333;
  mask = (mask | mask >> 2) & 0x0f0f;
  return (mask | mask >> 4) & 0xff;
}

/// The word that begins at a byte of a node; 0 where it does not end before `end`.
VOX_HD inline uint64_t word_at(const uint8_t* at, const uint8_t* end) {
  if (at >= end) return 0;
  uint64_t word = 0;
  uint32_t mask = *at++;
  if (end - at < static_cast<ptrdiff_t>(count_octants(mask))) return 0;
  for (; mask != 0; mask &= mask - 1) word |= static_cast<uint64_t>(*at++) << 8 * std::countr_zero(mask);
  return word;
}

/// A number of colours; where there are more than ten bytes of it, or it is cut off, it means nothing.
struct NodeCount {
  uint64_t colors = 0;
  const uint8_t* behind = nullptr;
};
VOX_HD inline NodeCount count_at(const uint8_t* at, const uint8_t* end) {
  if (end - at >= 4) {  // in one load, without a branch on how many bytes there are
    const uint32_t four = at[0] | static_cast<uint32_t>(at[1]) << 8 | static_cast<uint32_t>(at[2]) << 16 |
                          static_cast<uint32_t>(at[3]) << 24;
    if (const uint32_t last = ~four & 0x80808080u; last != 0) {
      const int top = std::countr_zero(last);
      const uint32_t own = four & ((2u << top) - 1);
      return {(own & 0x7f) | (own >> 1 & 0x3f80) | (own >> 2 & 0x1fc000) | (own >> 3 & 0xfe00000),
              at + top / 8 + 1};
    }
  }
  uint64_t colors = 0;
  for (int shift = 0; at < end && shift < 64; shift += 7) {
    const uint8_t byte = *at++;
    colors |= static_cast<uint64_t>(byte & 0x7f) << shift;
    if (byte < 0x80) break;
  }
  return {colors, at};
}

}  // namespace voxkit::color
