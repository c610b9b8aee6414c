// How many pages a TIFF file has (TIFF 6.0, section 2, and BigTIFF).
#pragma once

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <string>

#include "formats/result.h"

namespace voxkit {

/// Follows the chain of page directories. OpenImageIO cannot tell the last page from one whose directory lies
/// past the end of a file that was cut; such a file is an error here.
inline Result<int64_t> count_tiff_pages(const std::string& path) {
  std::ifstream file(path, std::ios_base::binary);
  file.seekg(0, std::ios_base::end);
  const auto size = static_cast<uint64_t>(file.tellg());
  bool big_endian = false;
  uint64_t at = 0;
  const auto number = [&](uint64_t bytes) {  // 0 past the end, where the stream fails
    unsigned char raw[8] = {};
    file.seekg(static_cast<int64_t>(std::min<uint64_t>(at, INT64_MAX)));
    file.read(reinterpret_cast<char*>(raw), static_cast<int64_t>(bytes));
    at += bytes;
    uint64_t value = 0;
    for (uint64_t i = 0; i < bytes; ++i) value |= uint64_t{raw[big_endian ? bytes - 1 - i : i]} << (8 * i);
    return value;
  };
  const uint64_t order = number(2);
  big_endian = order == 0x4d4d;
  const uint64_t version = number(2);
  if (!file || (order != 0x4d4d && order != 0x4949) || (version != 42 && version != 43))
    return bad_input(path, "not a TIFF file: expected its mark at byte 0");
  const bool big = version == 43;
  if (big) at += 4;
  const uint64_t offset_bytes = big ? 8 : 4, entry_bytes = big ? 20 : 12;
  int64_t pages = 0;
  for (uint64_t next = number(offset_bytes); next != 0;) {
    at = next;
    const uint64_t entries = number(big ? 8 : 2);
    if (entries > size / entry_bytes) file.setstate(std::ios_base::failbit);
    at += entries * entry_bytes;
    next = number(offset_bytes);
    // A page takes at least one entry: more pages than fit are a chain in a circle.
    if (!file || ++pages > static_cast<int64_t>(size / entry_bytes))
      return bad_input(path, "corrupt TIFF file: the directory of page " + std::to_string(pages) +
                                 " leads past the end of the file or back");
  }
  if (!file || pages == 0) return bad_input(path, "corrupt TIFF file: it has no pages");
  return pages;
}

}  // namespace voxkit
