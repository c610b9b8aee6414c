// What modules offer that work on images in memory: jpeg.so, jp2.so, png.so; imagequant.so.
#pragma once

#include "formats/image/coded_image.h"
#include "formats/module.h"

namespace voxkit {

/// `encode_image` and `decode_image` of coded_image.h for one format. decode: `image` has its size, and room.
struct ImageCodec {
  Result<std::vector<std::byte>> (*encode)(const RgbImage& image, const ImageCoding& coding) = nullptr;
  Status (*decode)(std::span<const std::byte> file, RgbImage& image) = nullptr;
};

/// Leaves up to so many colours, 2 to 256.
struct ImageQuantiser {
  Status (*quantise)(RgbImage& image, int colors, int quality) = nullptr;
};

}  // namespace voxkit
