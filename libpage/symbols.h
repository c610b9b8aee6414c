// Residuals as symbols: small ones are symbols of their own; of larger ones a symbol says the magnitude, and
// bits below it are stored as they are.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

namespace voxkit::page {

/// Symbols below this are folded residuals themselves.
inline constexpr uint32_t direct_symbols = 16;
/// Folded residuals have up to 32 bits: two symbols for each magnitude above.
inline constexpr uint32_t escape_symbol = direct_symbols + 2 * (32 - 4);
inline constexpr uint32_t symbol_count = escape_symbol + 1;

/// 0, -1, 1, -2, 2 … become 0, 1, 2, 3, 4 …; mirrored: 0, 1, -1, 2, -2 …
constexpr uint32_t fold(int32_t residual, uint32_t mirror) {
  const auto bits =
      static_cast<uint32_t>(mirror ? 0u - static_cast<uint32_t>(residual) : static_cast<uint32_t>(residual));
  return bits << 1 ^ (0u - (bits >> 31));
}
/// |residual|, 0..2^31.
constexpr uint32_t magnitude(uint32_t folded) {
  return (folded >> 1) + (folded & 1);
}
/// All ones where the residual is negative.
constexpr int64_t sign(uint32_t folded, uint32_t mirror) {
  return -static_cast<int64_t>((folded ^ mirror) & 1);
}

constexpr uint32_t symbol_of(uint32_t folded) {
  if (folded < direct_symbols) return folded;
  const auto exponent = static_cast<uint32_t>(std::bit_width(folded)) - 1;
  return direct_symbols + 2 * (exponent - 4) + (folded >> (exponent - 1) & 1);
}

/// What a symbol stands for: the folded residuals base … base + 2^raw_bits - 1.
struct Bin {
  uint32_t base;
  uint32_t raw_bits;
};
/// The escape stands for all: with it goes the folded residual in full.
constexpr std::array<Bin, 128> make_bins(uint32_t escape_bits) {
  std::array<Bin, 128> bins{};
  for (uint32_t s = 0; s < escape_symbol; ++s) {
    if (s < direct_symbols) {
      bins[s] = {s, 0};
    } else {
      const uint32_t exponent = 4 + (s - direct_symbols) / 2;
      bins[s] = {(2 + s % 2) << (exponent - 1), exponent - 1};
    }
  }
  bins[escape_symbol] = {0, escape_bits};
  return bins;
}

}  // namespace voxkit::page
