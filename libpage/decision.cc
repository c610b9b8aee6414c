#include "libpage/decision.h"

namespace voxkit::page {
namespace {

constexpr int number_bits = 5, run_golomb = 2;

}  // namespace

void write_decision_numbers(BitWriter& out, std::span<const uint8_t> numbers) {
  uint32_t unknown = 0;
  for (const uint8_t number : numbers) {
    if (number == 0) {
      ++unknown;
      continue;
    }
    out.golomb(unknown, run_golomb);
    out.put(number, number_bits);
    unknown = 0;
  }
  if (unknown != 0) out.golomb(unknown, run_golomb);
}

bool read_decision_numbers(BitReader& in, std::span<uint8_t> numbers) {
  for (size_t c = 0; c < numbers.size(); ++c) {
    const uint32_t unknown = in.golomb(run_golomb);
    if (in.overrun() || unknown > numbers.size() - c) return false;
    c += unknown;
    if (c == numbers.size()) break;
    const uint32_t number = in.get(number_bits);
    if (number == 0) return false;
    numbers[c] = static_cast<uint8_t>(number);
  }
  return true;
}

}  // namespace voxkit::page
