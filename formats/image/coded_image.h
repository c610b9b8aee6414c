// Images of 8 bits as the bytes of a JPEG, JPEG 2000 or PNG file, and back. The libraries behind them are
// optional modules, loaded when first used.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/result.h"

namespace voxkit {

enum class ImageFormat { jpeg, jp2, png };

/// Pixels; at least 1 x 1.
struct ImageSize {
  uint32_t width = 0, height = 0;
  friend bool operator==(const ImageSize&, const ImageSize&) = default;
};

/// Rows from top to bottom, each R, G, B of its pixels, sRGB, without gaps.
struct RgbImage {
  ImageSize size;
  std::vector<std::byte> rgb;  ///< 3 * width * height
};
inline RgbImage make_rgb_image(ImageSize size) {
  return {size, std::vector<std::byte>(size_t{3} * size.width * size.height)};
}

/// How an image is encoded.
struct ImageCoding {
  /// 0 to 100. jpeg: that of libjpeg; 4:4:4 from 90 on, 4:2:0 below. jp2: 100 is lossless; else about
  /// 1/5 of 24 bits a pixel at 80, and half as many for each 20 less. png: 100 is lossless; below that, and
  /// with a palette, that of libimagequant.
  int quality = 100;
  /// Of png: most colours, 2 to 256; 0: all there are, or 256 if the quality is below 100.
  int palette = 0;
  /// Of jp2: pixels that matter, 1 or more, of which the size is a share; the others cost little.
  uint64_t pixels = 0;
};

/// Whether such an image is quantised, which takes libimagequant.
constexpr bool is_quantised(ImageFormat format, const ImageCoding& coding) {
  return format == ImageFormat::png && (coding.palette != 0 || coding.quality < 100);
}

/// An error (ErrorCode::input) that names the package, where this build has no such codec.
Status image_codec_support(ImageFormat format);
/// The same of encoding as asked for: ErrorCode::usage.
Status image_encoder_support(ImageFormat format, const ImageCoding& coding);

/// The bytes of a file. They depend on nothing but the arguments and the version of the library.
Result<std::vector<std::byte>> encode_image(ImageFormat format, const RgbImage& image,
                                            const ImageCoding& coding);

/// The pixels of a file, which must be of this size: that is checked first. JPEG: grey or of 3 components;
/// JPEG 2000: as formats/image/jp2_codestream.h says; PNG: of up to 8 bits, without alpha. Safe on any bytes.
/// Memory: up to image_work_bytes() and the image. Errors: ErrorCode::input, without a file's name.
Result<RgbImage> decode_image(ImageFormat format, std::span<const std::byte> file, ImageSize size);

/// Bytes that encoding or decoding takes at most beside the image and the file, for memory limits.
uint64_t image_work_bytes(ImageFormat format, ImageSize size);

}  // namespace voxkit
