// Decisions between two: how probable one is in each of many contexts, and a model's bits for that.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "libpage/bits.h"
#include "libpage/rans.h"

namespace voxkit::page {

/// Parts of 2048 that the first of two may have, by number. Number 0 is that of contexts which no sample had.
inline constexpr std::array<uint16_t, 32> decision_parts = {
    1024, 1,   2,    4,    7,    12,   20,   32,   48,   72,   104,  148,  208,  288,  392,  528,
    700,  900, 1148, 1348, 1520, 1656, 1760, 1840, 1900, 1944, 1976, 2000, 2016, 2028, 2041, 2047};

/// How often it was the second, and the first.
using DecisionCounts = std::array<uint64_t, 2>;

/// The number of the part nearest to what was seen, as if half a decision more of each had been.
inline uint8_t decision_number(const DecisionCounts& counts) {
  const auto [seconds, firsts] = counts;
  if (seconds + firsts == 0) return 0;
  const uint64_t part = (2 * firsts + 1) * table_total / (2 * (seconds + firsts) + 2);
  size_t best = 1;
  for (size_t n = 2; n < decision_parts.size(); ++n)
    if (decision_parts[n - 1] + decision_parts[n] < 2 * part) best = n;
  return static_cast<uint8_t>(best);
}

void write_decision_numbers(BitWriter& out, std::span<const uint8_t> numbers);
/// False, or `in` is overrun, where they are not as they should be.
bool read_decision_numbers(BitReader& in, std::span<uint8_t> numbers);

/// A symbol of two.
struct Decision {
  uint16_t part, start;
};
/// The first of two has this part of 2048, which is neither 0 nor all.
inline Decision decision_of_part(uint32_t part, bool first) {
  return first ? Decision{static_cast<uint16_t>(part), 0}
               : Decision{static_cast<uint16_t>(table_total - part), static_cast<uint16_t>(part)};
}
inline Decision decision(uint8_t number, bool first) {
  return decision_of_part(decision_parts[number], first);
}
/// Reads one, and renews the state.
inline bool decide_of_part(RansDecoder& coder, uint32_t part) {
  const auto slot = static_cast<uint32_t>(coder.state & (table_total - 1));
  const bool first = slot < part;
  coder.state = (coder.state >> table_bits) * (first ? part : table_total - part) + slot - (first ? 0 : part);
  coder.renew();
  return first;
}
inline bool decide(RansDecoder& coder, uint8_t number) {
  return decide_of_part(coder, decision_parts[number]);
}

}  // namespace voxkit::page
