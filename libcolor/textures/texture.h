// Parts of the colours as images, and these as blocks of textures that GPUs read (section 4.1 of the paper;
// FORMAT.md, section 4.6).
#pragma once

#include <array>
#include <span>
#include <string>

#include "libcolor/encoded_part.h"
#include "libcolor/params.h"
#include "libcolor/textures/texture_layout.h"

namespace voxkit::color {

/// Pixels of the largest block.
inline constexpr size_t most_block_pixels = 144;

/// Bytes of a block.
uint32_t texture_block_bytes(ColorCodec codec);
/// Bytes of a part of so many colours, 1 to 2^20.
uint64_t texture_bytes(const Params& params, uint32_t colors);

/// An error that says what is missing, where this build cannot read and write a codec.
Status texture_support(ColorCodec codec);

/// Encodes 1 to 2^20 colours as a part.
EncodedPart encode_texture(std::span<const Rgb> colors, const Options& options);

/// The colours of a part, one after the other or in any order. Safe on any bytes.
class TextureReader {
 public:
  /// A part of so many colours. `bytes`: texture_bytes() of them, which stay.
  void open(const std::byte* bytes, const Params& params, uint32_t colors);
  /// Colour `index` of the part, which has it.
  Rgb color(uint32_t index) {
    const Pixel at = curve_pixel(curve_, index);
    if (const uint32_t block = layout_.block_of(index, at); block != block_) decode(block);
    return pixels_[layout_.within(at)];
  }
  /// Blocks of the part; which of them is first not valid, or that number.
  uint32_t blocks() const { return layout_.blocks(); }
  uint32_t first_invalid() const;

 private:
  void decode(uint32_t block);
  const std::byte* bytes_of(uint32_t block) const {
    return bytes_ + uint64_t{block} * texture_block_bytes(codec_);
  }

  const std::byte* bytes_ = nullptr;
  ColorCodec codec_ = ColorCodec::bc1;
  ImageCurve curve_ = ImageCurve::morton;
  TextureLayout layout_;
  uint32_t block_ = ~uint32_t{0};
  std::array<Rgb, most_block_pixels> pixels_;
};

/// What in a part of so many colours is not as FORMAT.md says, in words; empty if nothing is.
std::string check_texture_part(std::span<const std::byte> part, const Params& params, uint32_t colors);

}  // namespace voxkit::color
