// Parts of the colours as images, and these as blocks of textures that GPUs read (section 4.1 of the paper;
// FORMAT.md, section 4.6).
#pragma once

#include <array>
#include <span>

#include "libcolor/color.h"
#include "libcolor/encoded_part.h"

namespace voxkit::color {

/// Bytes of a part of so many colours, 1 to 2^20.
uint64_t texture_bytes(const Params& params, uint32_t colors);

/// Encodes 1 to 2^20 colours as a part.
EncodedPart encode_texture(std::span<const Rgb> colors, const Options& options);

/// The colours of a part, one after the other or in any order. Safe on any bytes.
class TextureReader {
 public:
  /// `bytes`: texture_bytes() of them, which stay.
  void open(const std::byte* bytes, const Params& params) {
    bytes_ = bytes;
    curve_ = params.image_curve;
    block_ = ~uint32_t{0};
  }
  /// Colour `index` of the part, which has it.
  Rgb color(uint32_t index) {
    const Pixel at = curve_pixel(curve_, index);
    if (const uint32_t block = index / 16; block != block_) decode(block);
    return pixels_[at.y % 4 * 4 + at.x % 4];
  }
  /// Blocks that have been decoded.
  uint64_t blocks() const { return decoded_; }

 private:
  void decode(uint32_t block);

  const std::byte* bytes_ = nullptr;
  ImageCurve curve_ = ImageCurve::morton;
  uint32_t block_ = ~uint32_t{0};
  uint64_t decoded_ = 0;
  std::array<Rgb, 16> pixels_;
};

}  // namespace voxkit::color
