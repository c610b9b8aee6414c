// Static tables of how probable each symbol is, in parts of 2048.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "libpage/bits.h"
#include "libpage/symbols.h"

namespace voxkit::page {

inline constexpr int table_bits = 11;
inline constexpr uint32_t table_total = 1u << table_bits;

/// Parts of each symbol; their sum is 2048. That of the escape is never 0, so that whatever has none can be
/// coded.
using Frequencies = std::array<uint16_t, symbol_count>;

/// The parts with which symbols that occur this often take fewest bits, or nearly so.
Frequencies normalise(const std::array<uint64_t, symbol_count>& counts);

void write_frequencies(BitWriter& out, const Frequencies& table);
/// False where what is there is no table.
bool read_frequencies(BitReader& in, Frequencies& table);

/// What a decoder needs to know of a symbol, in one word: base of the folded residual in bits 0..31, number
/// of raw bits in 32..39, part in 40..51, first slot in 52..62.
struct DecodingTable {
  std::array<uint8_t, table_total> symbol_at;  ///< for each value of the state's low bits
  std::array<uint64_t, symbol_count> word;
};
void fill_decoding_table(const Frequencies& table, uint32_t escape_bits, DecodingTable& out);

/// First slot of each symbol.
std::array<uint16_t, symbol_count> starts(const Frequencies& table);

}  // namespace voxkit::page
