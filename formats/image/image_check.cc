#include "formats/image/image_check.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <span>
#include <string_view>
#include <utility>

#include "formats/little_endian.h"
#include "formats/mapped_file.h"

namespace voxkit {
namespace {

/// Bytes of the OpenEXR attribute types whose readers take that many, whatever the file says.
constexpr std::pair<std::string_view, size_t> exr_sizes[] = {{"box2f", 16},
                                                             {"box2i", 16},
                                                             {"chromaticities", 32},
                                                             {"compression", 1},
                                                             {"deepImageState", 1},
                                                             {"double", 8},
                                                             {"envmap", 1},
                                                             {"float", 4},
                                                             {"int", 4},
                                                             {"keycode", 28},
                                                             {"lineOrder", 1},
                                                             {"m33d", 72},
                                                             {"m33f", 36},
                                                             {"m44d", 128},
                                                             {"m44f", 64},
                                                             {"rational", 8},
                                                             {"tiledesc", 9},
                                                             {"timecode", 8},
                                                             {"v2d", 16},
                                                             {"v2f", 8},
                                                             {"v2i", 8},
                                                             {"v3d", 24},
                                                             {"v3f", 12},
                                                             {"v3i", 12}};

/// Whether the value of an OpenEXR attribute ends where its size says, for the types that end elsewhere if
/// they like.
bool exr_value_fits(std::string_view type, std::span<const std::byte> value) {
  for (const auto& [name, size] : exr_sizes)
    if (type == name) return value.size() == size;
  if (type == "preview") {
    if (value.size() < 8) return false;
    const uint64_t pixels = uint64_t{load_le<uint32_t>(value.data())} * load_le<uint32_t>(value.data() + 4);
    return (value.size() - 8) % 4 == 0 && pixels == (value.size() - 8) / 4;
  }
  if (type == "stringvector") {
    while (!value.empty()) {
      if (value.size() < 4 || load_le<uint32_t>(value.data()) > value.size() - 4) return false;
      value = value.subspan(4 + load_le<uint32_t>(value.data()));
    }
  }
  if (type == "chlist") {
    while (!value.empty() && value[0] != std::byte{0}) {
      const auto name_end = std::find(value.begin(), value.end(), std::byte{0});
      if (value.end() - name_end < 17) return false;
      value = value.subspan(static_cast<size_t>(name_end - value.begin()) + 17);
    }
    return value.size() == 1;
  }
  return type != "idmanifest";  // belongs to deep images, which are no volumes; unpacks to any size
}

uint32_t load_be(const std::byte* p) {
  return __builtin_bswap32(load_le<uint32_t>(p));
}

}  // namespace

Status check_image_pixels(const std::string& path, int64_t width, int64_t height) {
  if (width < 1 || height < 1 || width <= max_image_pixels / height) return {};
  return bad_input(path, fmt::format("image of {} x {} pixels: expected at most 2^31", width, height));
}

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

Status check_jpeg(const std::string& path) {
  VOX_TRY(const auto file, MappedFile::open(path));
  const auto bytes = file->bytes();
  const auto byte = [&](size_t at) { return std::to_integer<unsigned>(bytes[at]); };
  if (bytes.size() < 2 || byte(0) != 0xff || byte(1) != 0xd8)
    return bad_input(path, "not a JPEG file: expected its mark at byte 0");
  const auto no_data = [](unsigned marker) { return marker <= 1 || (marker >= 0xd0 && marker <= 0xd7); };
  // A segment: 0xff, a marker, and for most a length and data. Between segments there is coded data, where
  // 0xff is followed by 0 or by a marker without data.
  for (size_t at = 2; bytes.size() - at >= 2; ++at) {
    const unsigned marker = byte(at + 1);
    if (byte(at) != 0xff || marker == 0xff || no_data(marker)) continue;
    if (marker == 0xd9) return {};
    if (bytes.size() - at < 4) break;
    const size_t length = byte(at + 2) << 8 | byte(at + 3);
    if (length > bytes.size() - at - 2) break;
    at += length + 1;
  }
  return bad_input(path, fmt::format("JPEG file ends after {} bytes: expected its end mark", bytes.size()));
}

Status check_exr(const std::string& path, uint64_t memory_limit) {
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
  uint64_t width = 0, channels = 1;
  // Attributes: name, type, size, value. An empty name ends a header; of many, an empty header the last.
  for (bool first = true;; first = false) {
    const size_t name_end = text.find('\0', at);
    if (name_end == text.npos) return broken("it leads past the end of the file");
    if (name_end == at) {
      // OpenEXR takes buffers for whole chunks of rows when it opens a file.
      if (unpacking_bytes(width * channels * 4) > memory_limit / 2)
        return fail(ErrorCode::limit, path,
                    fmt::format("rows of {} pixels take more than half of --max-memory, {}, to unpack", width,
                                memory_limit));
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
    const std::string_view type = text.substr(name_end + 1, type_end - name_end - 1);
    if (!exr_value_fits(type, bytes.subspan(type_end + 5, static_cast<size_t>(size))))
      return broken("the value of an attribute is not of the size that the file says");
    const std::byte* value = bytes.data() + type_end + 5;
    if (type == "box2i" && text.substr(at, name_end - at) == "dataWindow") {
      const int64_t extent = int64_t{load_le<int32_t>(value + 8)} - load_le<int32_t>(value) + 1;
      width = static_cast<uint64_t>(std::max<int64_t>(extent, 0));
    }
    if (type == "chlist")
      channels = static_cast<uint64_t>(size) / 18 + 1;  // a name of a letter or more, its end, 16 bytes
    at = type_end + 5 + static_cast<size_t>(size);
  }
}

}  // namespace voxkit
