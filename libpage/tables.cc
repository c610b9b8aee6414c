#include "libpage/tables.h"

#include <algorithm>
#include <bit>

namespace voxkit::page {

Frequencies normalise(const std::array<uint64_t, symbol_count>& counts) {
  uint64_t total = 0;
  for (const uint64_t count : counts) total += count;
  Frequencies table{};
  table[escape_symbol] = 1;
  if (total == 0) {
    table[0] = table_total - 1;
    return table;
  }
  // A symbol that would get less than about half a part is left to the escape.
  std::array<uint64_t, symbol_count> kept = counts;
  kept[escape_symbol] = 0;
  uint64_t kept_total = 0;
  for (uint64_t& count : kept) {
    if (count != 0 && count * (2 * table_total) < total) count = 0;
    kept_total += count;
  }
  uint64_t escapes = std::max<uint64_t>(total - kept_total, 1);
  kept[escape_symbol] = escapes;
  kept_total += escapes;
  uint32_t given = 0;
  for (uint32_t s = 0; s < symbol_count; ++s)
    if (kept[s] != 0) {
      table[s] =
          static_cast<uint16_t>(std::max<uint64_t>(1, (kept[s] * table_total + kept_total / 2) / kept_total));
      given += table[s];
    }
  // What is left over or overdrawn goes where it costs least: a part more of a symbol saves about
  // count / part.
  while (given != table_total) {
    const bool more = given < table_total;
    uint32_t best = escape_symbol;
    bool found = false;
    for (uint32_t s = 0; s < symbol_count; ++s) {
      if (kept[s] == 0 || (!more && table[s] < 2)) continue;
      const uint64_t part = more ? table[s] : table[s] - 1u,
                     best_part = more ? table[best] : table[best] - 1u;
      const bool better =
          more ? kept[s] * best_part > kept[best] * part : kept[s] * best_part < kept[best] * part;
      if (!found || better) {
        best = s;
        found = true;
      }
    }
    table[best] = static_cast<uint16_t>(table[best] + (more ? 1 : -1));
    given += more ? 1u : -1u;
  }
  return table;
}

namespace {
/// About how many bits the next part has, from the one before.
int width_after(uint32_t part) {
  return std::max(0, static_cast<int>(std::bit_width(part)) - 2);
}
}  // namespace

void write_frequencies(BitWriter& out, const Frequencies& table) {
  uint32_t used = 0;  // symbols up to the last one that has a part
  for (uint32_t s = 0; s < escape_symbol; ++s)
    if (table[s] != 0) used = s + 1;
  out.put(used, 7);
  uint32_t before = table_total / 4;
  for (uint32_t s = 0; s < used; ++s) {
    out.golomb(table[s], width_after(before));
    before = table[s];
  }
}

bool read_frequencies(BitReader& in, Frequencies& table) {
  table = {};
  const uint32_t used = in.get(7);
  if (used > escape_symbol) return false;
  uint32_t before = table_total / 4, given = 0;
  for (uint32_t s = 0; s < used; ++s) {
    before = in.golomb(width_after(before));
    if (before >= table_total || in.overrun()) return false;
    table[s] = static_cast<uint16_t>(before);
    given += before;
  }
  if (given >= table_total || (used != 0 && table[used - 1] == 0)) return false;
  table[escape_symbol] = static_cast<uint16_t>(table_total - given);
  return true;
}

void fill_decoding_table(const Frequencies& table, uint32_t escape_bits, DecodingTable& out) {
  const auto bins = make_bins(escape_bits);
  uint32_t slot = 0;
  for (uint32_t s = 0; s < symbol_count; ++s) {
    out.word[s] =
        bins[s].base | uint64_t{bins[s].raw_bits} << 32 | uint64_t{table[s]} << 40 | uint64_t{slot} << 52;
    for (uint32_t i = 0; i < table[s]; ++i) out.symbol_at[slot++] = static_cast<uint8_t>(s);
  }
}

std::array<uint16_t, symbol_count> starts(const Frequencies& table) {
  std::array<uint16_t, symbol_count> first{};
  uint32_t slot = 0;
  for (uint32_t s = 0; s < symbol_count; ++s) {
    first[s] = static_cast<uint16_t>(slot);
    slot += table[s];
  }
  return first;
}

}  // namespace voxkit::page
