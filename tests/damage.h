// Damaging containers on purpose: seeded changes, and the checksums made right again, so that what stands
// behind them is attacked too.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <random>
#include <span>
#include <vector>

#include "formats/container.h"
#include "formats/little_endian.h"
#define XXH_INLINE_ALL
#include <xxhash.h>

namespace voxkit::test {

using Bytes = std::vector<std::byte>;

inline uint64_t checksum(std::span<const std::byte> bytes) {
  return XXH64(bytes.data(), bytes.size(), 0);
}

/// Where the table of a container lies, as far as its trailer can be believed.
struct TablePlace {
  size_t offset = 0, entries = 0;
};
inline TablePlace table_of(const Bytes& file) {
  if (file.size() < 128) return {};
  const uint64_t entries = load_le<uint64_t>(&file[file.size() - 48]);
  if (entries > (file.size() - 128) / 64) return {};
  return {file.size() - 64 - 64 * entries, entries};
}

/// Makes every checksum right: of the chunks that lie in the file, the table, the trailer and the header.
inline void reseal(Bytes& file) {
  if (file.size() < 128) return;
  std::byte* const trailer = &file[file.size() - 64];
  const TablePlace table = table_of(file);
  for (size_t i = 0; i < table.entries; ++i) {
    std::byte* const entry = &file[table.offset + 64 * i];
    const auto offset = load_le<uint64_t>(entry + 16), length = load_le<uint64_t>(entry + 24);
    if (offset <= file.size() && length <= file.size() - offset)
      store_le(entry + 32, checksum(std::span(file).subspan(offset, length)));
  }
  store_le(trailer + 32, checksum(std::span(file).subspan(table.offset, 64 * table.entries)));
  store_le(trailer + 56, checksum(std::span(trailer, 56)));
  store_le(&file[56], checksum(std::span(file).first(56)));
}

/// Also makes right what opening a container asks of the header and the trailer, whatever the length has
/// become.
inline void repair(Bytes& file, Codec codec = Codec::svmm) {
  if (file.size() < 128) return;
  std::memcpy(file.data(), container_magic.data(), container_magic.size());
  store_le(&file[8], container_version);
  store_le(&file[10], static_cast<uint16_t>(codec));
  std::byte* const trailer = &file[file.size() - 64];
  std::memcpy(trailer, "VOXTABLE", 8);
  const uint64_t entries = load_le<uint64_t>(trailer + 16) % ((file.size() - 128) / 64 + 1);
  store_le(trailer + 8, file.size() - 64 - 64 * entries);
  store_le(trailer + 16, entries);
  store_le<uint64_t>(trailer + 24, file.size());
  reseal(file);
}

/// Changes one to three places at `from` or behind: single bits and bytes, extreme or nearly right numbers of
/// 1 to 8 bytes, a number from elsewhere, and, where `keep_length` is false, bytes lost, doubled or cut off.
inline void damage(Bytes& file, size_t from, size_t to, bool keep_length, std::mt19937& random) {
  for (auto changes = 1 + random() % 3; changes > 0; --changes) {
    to = std::min(to, file.size());
    if (from + 8 > to) return;
    const size_t at = from + random() % (to - from);
    const size_t width = std::min<size_t>(size_t{1} << random() % 4, file.size() - at);
    switch (random() % (keep_length ? 5 : 8)) {
      case 0:
        file[at] ^= static_cast<std::byte>(1u << random() % 8);
        break;
      case 1:
        file[at] = static_cast<std::byte>(random());
        break;
      case 2: {
        constexpr uint64_t extremes[] = {0,
                                         1,
                                         2,
                                         0x7fffffff,
                                         0x80000000,
                                         0xffffffff,
                                         0x100000000,
                                         uint64_t{1} << 56,
                                         uint64_t{1} << 62,
                                         uint64_t{1} << 63,
                                         ~uint64_t{0},
                                         ~uint64_t{0} - 63,
                                         0x7ff8000000000000};
        const uint64_t value = extremes[random() % std::size(extremes)];
        std::memcpy(&file[at], &value, width);
        break;
      }
      case 3: {  // the field that begins here, a little more or less
        const size_t field = at - at % width;
        uint64_t value = 0;
        std::memcpy(&value, &file[field], width);
        value += random() % 2 ? 1 + random() % 64 : 0 - uint64_t{1 + random() % 64};
        std::memcpy(&file[field], &value, width);
        break;
      }
      case 4:
        std::memmove(&file[at], &file[random() % (file.size() - width + 1)], width);
        break;
      case 5:
        file.erase(file.begin() + static_cast<ptrdiff_t>(at),
                   file.begin() + static_cast<ptrdiff_t>(at + width));
        break;
      case 6: {
        const Bytes again(file.begin() + static_cast<ptrdiff_t>(at),
                          file.begin() + static_cast<ptrdiff_t>(at + width));
        file.insert(file.begin() + static_cast<ptrdiff_t>(at), again.begin(), again.end());
        break;
      }
      default:
        if (random() % 8 == 0) file.resize(at);
        break;
    }
  }
}

}  // namespace voxkit::test
