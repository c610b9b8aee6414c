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

/// One slot for each value of the state's low bits: part - 1 in bits 0..10, place within the symbol's slots
/// in 11..21, symbol from 22 on.
void fill_slots(const Frequencies& table, std::span<uint32_t, table_total> slots);

/// First slot of each symbol.
std::array<uint16_t, symbol_count> starts(const Frequencies& table);

}  // namespace voxkit::page
