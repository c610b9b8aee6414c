// The samples of a PNG file as they are stored, by libpng.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/result.h"

namespace voxkit {

/// What a PNG file says before its pixels.
struct PngHead {
  int64_t width = 0, height = 0;
  int bits = 8, samples = 1;  ///< of a sample; of a pixel: 1 grey or index, 2 grey and alpha, 3 RGB, 4 RGBA
  std::vector<std::array<uint8_t, 4>> palette;       ///< RGBA; empty: pixels are no indices
  bool translucent = false;                          ///< some entry of the palette has alpha
  bool transparent_value = false;                    ///< one value, or colour, stands for void
  std::array<uint8_t, 3> void_color{};               ///< that colour, of 8 bits
  std::optional<std::array<uint32_t, 2>> per_metre;  ///< pixels along x and y
  std::optional<std::array<uint32_t, 2>> per_unit;   ///< the same, of a unit that is not said
};

/// Checks the whole file (image_check.h) and reads what stands before the pixels. Errors: ErrorCode::input.
Result<PngHead> read_png_head(const std::string& path);

/// All samples, row by row: a byte each, or 16 bits of this machine's byte order; of less than 8 bits as
/// they are, not scaled. `samples` has room for `head`, which the file must still have. Errors:
/// ErrorCode::input. libpng's own words do not go to standard error.
Status read_png_samples(const std::string& path, const PngHead& head, std::byte* samples);

}  // namespace voxkit
