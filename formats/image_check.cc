#include "formats/image_check.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>

#include "formats/little_endian.h"
#include "formats/mapped_file.h"

namespace voxkit {
namespace {

uint32_t load_be(const std::byte* p) {
  return __builtin_bswap32(load_le<uint32_t>(p));
}

}  // namespace

Status check_png(const std::string& path) {
  VOX_TRY(const auto file, MappedFile::open(path));
  const auto bytes = file->bytes();
  constexpr std::array<unsigned char, 8> signature{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  if (bytes.size() < 8 || std::memcmp(bytes.data(), signature.data(), 8) != 0)
    return bad_input(path, "not a PNG file: expected its signature at byte 0");
  // A chunk: length of the data, type, data, checksum of type and data.
  for (size_t at = 8; bytes.size() - at >= 12;) {
    const size_t length = load_be(bytes.data() + at);
    if (length > bytes.size() - at - 12) break;
    const auto* type = reinterpret_cast<const Bytef*>(bytes.data() + at + 4);
    if (crc32_z(0, type, length + 4) != load_be(bytes.data() + at + 8 + length))
      return bad_input(path, fmt::format("corrupt PNG file: chunk at byte {}: its checksum is wrong", at));
    if (std::memcmp(type, "IEND", 4) == 0) return {};
    at += 12 + length;
  }
  return bad_input(path, fmt::format("PNG file ends after {} bytes: expected further chunks", bytes.size()));
}

Status check_exr(const std::string& path) {
  VOX_TRY(const auto file, MappedFile::open(path));
  const auto bytes = file->bytes();
  constexpr uint32_t magic = 20000630, many_parts = 0x1000;
  if (bytes.size() < 8 || load_le<uint32_t>(bytes.data()) != magic)
    return bad_input(path, "not an OpenEXR file: expected its magic number at byte 0");
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const bool parts = (load_le<uint32_t>(bytes.data() + 4) & many_parts) != 0;
  size_t at = 8;
  const auto broken = [&](const char* why) {
    return bad_input(path, fmt::format("corrupt OpenEXR file: header at byte {}: {}", at, why));
  };
  // Attributes: name, type, size, value. An empty name ends a header; of many, an empty header the last.
  for (bool first = true;; first = false) {
    const size_t name_end = text.find('\0', at);
    if (name_end == text.npos) return broken("it leads past the end of the file");
    if (name_end == at) {
      ++at;
      if (first || !parts || (at < text.size() && text[at] == '\0')) return {};
      continue;
    }
    const size_t type_end = text.find('\0', name_end + 1);
    if (type_end == text.npos || text.size() - type_end < 5)
      return broken("it leads past the end of the file");
    const auto size = load_le<int32_t>(bytes.data() + type_end + 1);
    if (size < 0 || static_cast<size_t>(size) > text.size() - type_end - 5)
      return broken("an attribute leads past the end of the file");
    at = type_end + 5 + static_cast<size_t>(size);
  }
}

}  // namespace voxkit
