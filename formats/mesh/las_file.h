// What is in a LAS file: its header, and where the fields of its points are (ASPRS, "LAS specification
// 1.4-R15").
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include "formats/result.h"

namespace voxkit::las {

struct Header {
  uint8_t format = 0;                       ///< of points, 0 to 10
  uint64_t points = 0, begin = 0;           ///< how many, and where the first is
  size_t stride = 0;                        ///< bytes of a point
  glm::dvec3 scale{1}, offset{0};           ///< stored whole numbers n are at n * scale + offset
  size_t color = 0;                         ///< where of a point red, green and blue are; 0: nowhere
  size_t flags = 0;                         ///< where its flags are
  size_t label = 0;                         ///< where its class is
  uint8_t label_mask = 0xff;                ///< which bits of that
  std::byte withheld{0};                    ///< which of them says that it is to be left out
  std::vector<std::string> fields_dropped;  ///< all but places, intensity and colours
  std::vector<std::string> notes;           ///< what else of the file is left out
};
/// Where intensities of 16 bits are.
inline constexpr size_t intensity_at = 12;

/// The header at the beginning of a file. All its points are within the file. `path` is for messages.
/// ErrorCode::input, also for compressed files.
Result<Header> read_header(std::span<const std::byte> bytes, const std::string& path);

}  // namespace voxkit::las
