// Small files of points to read.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "tests/formats/mesh_files.h"

namespace voxkit {

/// A PCD file: fields are named as "x y z rgb"; sizes, types and counts likewise.
struct PcdFile {
  std::string fields = "x y z", sizes = "4 4 4", types = "F F F", counts = "1 1 1";
  uint64_t width = 2, height = 1;
  std::string viewpoint = "0 0 0 1 0 0 0";
  std::string header(const std::string& data) const {
    return fmt::format(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT {}\n"
        "WIDTH {}\nHEIGHT {}\nVIEWPOINT {}\nPOINTS {}\nDATA {}\n",
        fields, sizes, types, counts, width, height, viewpoint, width * height, data);
  }
  std::string ascii(const std::string& lines) const { return header("ascii") + lines; }
  std::string binary(const std::string& points) const { return header("binary") + points; }
  /// `packed` becomes `size` bytes: all numbers of a field, then those of the next.
  std::string compressed(const std::string& packed, size_t size) const {
    return header("binary_compressed") +
           bytes_of(
               std::vector<uint32_t>{static_cast<uint32_t>(packed.size()), static_cast<uint32_t>(size)}) +
           packed;
  }
};
/// LZF that only has bytes as they are, up to 32 at once.
inline std::string lzf_literals(const std::string& bytes) {
  std::string packed;
  for (size_t at = 0; at < bytes.size(); at += 32) {
    const std::string run = bytes.substr(at, 32);
    packed += static_cast<char>(run.size() - 1) + run;
  }
  return packed;
}

/// A LAS file, as bytes of its header that are set, records, and points.
struct LasFile {
  int format = 2, minor = 2;
  std::array<double, 3> scale{0.01, 0.01, 0.01}, offset{0, 0, 0};
  size_t extra = 0;     ///< bytes a point more than its format has
  std::string records;  ///< between header and points
  uint32_t record_count = 0;
  std::string tail;         ///< behind the points
  uint32_t tail_count = 0;  ///< records there
  struct Point {
    std::array<int32_t, 3> at{};
    std::array<uint16_t, 3> color{};
    uint16_t intensity = 0;
    uint8_t flags = 0;  ///< byte 15
  };
  std::vector<Point> points;

  static size_t bytes_of_format(int format) {
    constexpr size_t bytes[] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
    return bytes[format];
  }
  size_t header_bytes() const { return minor < 3 ? 227 : minor == 3 ? 235 : 375; }
  static std::string record(const std::string& user, uint16_t id, const std::string& data,
                            bool is_long = false) {
    std::string head(is_long ? 60 : 54, '\0');
    head.replace(2, user.size(), user);
    std::memcpy(&head[18], &id, 2);
    const uint64_t length = data.size();
    std::memcpy(&head[20], &length, is_long ? 8 : 2);
    return head + data;
  }
  std::string text() const {
    std::string out(header_bytes(), '\0');
    const auto set = [&](size_t at, auto value) { std::memcpy(&out[at], &value, sizeof value); };
    out.replace(0, 4, "LASF");
    out[24] = 1;
    out[25] = static_cast<char>(minor);
    set(94, static_cast<uint16_t>(header_bytes()));
    set(96, static_cast<uint32_t>(header_bytes() + records.size()));
    set(100, record_count);
    out[104] = static_cast<char>(format);
    const size_t stride = bytes_of_format(format) + extra;
    set(105, static_cast<uint16_t>(stride));
    set(107, static_cast<uint32_t>(format >= 6 ? 0 : points.size()));
    for (size_t a = 0; a < 3; ++a) {
      set(131 + 8 * a, scale[a]);
      set(155 + 8 * a, offset[a]);
    }
    if (minor >= 4) {
      set(235,
          static_cast<uint64_t>(tail_count ? header_bytes() + records.size() + stride * points.size() : 0));
      set(243, tail_count);
      set(247, static_cast<uint64_t>(points.size()));
    }
    out += records;
    for (const Point& point : points) {
      std::string bytes(stride, '\7');  // what does not count is not 0
      std::memcpy(&bytes[0], point.at.data(), 12);
      std::memcpy(&bytes[12], &point.intensity, 2);
      bytes[15] = static_cast<char>(point.flags);
      constexpr size_t colors[] = {0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};
      if (const size_t at = colors[format]; at > 0) std::memcpy(&bytes[at], point.color.data(), 6);
      out += bytes;
    }
    return out + tail;
  }
};

}  // namespace voxkit
