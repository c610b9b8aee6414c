// Whether PNG, JPEG and OpenEXR files are whole, before OpenImageIO opens them.
#pragma once

#include <cstdint>
#include <string>

#include "formats/result.h"

namespace voxkit {

/// Images of more pixels are refused, whatever the memory: a few bytes may stand for them.
inline constexpr int64_t max_image_pixels = int64_t{1} << 31;
/// ErrorCode::input where an image of that size has more.
Status check_image_pixels(const std::string& path, int64_t width, int64_t height);

/// Follows the chunks of a PNG file and checks their checksums. libpng finds the same damage, but writes to
/// standard error.
Status check_png(const std::string& path);

/// Follows the segments of a JPEG file to its end. libjpeg fills up what a cut file lacks with grey.
Status check_jpeg(const std::string& path);

/// What the libraries take to unpack rows of that size, up to 256 or a whole strip at once, whatever the
/// height of the image; 0 where that is too little to matter, below 64 MiB.
constexpr uint64_t unpacking_bytes(uint64_t row_bytes, uint64_t strip_rows = 0) {
  const uint64_t rows = strip_rows > 256 ? strip_rows : 256;
  return row_bytes < (uint64_t{64} << 20) / rows ? 0 : rows * row_bytes;
}

/// Follows the attributes of an OpenEXR file's headers. OpenEXR allocates as much as an attribute's size
/// says, up to 2 GiB, and rows of the width that it says. ErrorCode::limit where these take over half of
/// `memory_limit`.
Status check_exr(const std::string& path, uint64_t memory_limit);

}  // namespace voxkit
