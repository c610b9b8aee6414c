#include "libcolor/textures/texture.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "libcolor/textures/astc.h"
#include "libcolor/textures/bc1.h"
#include "libcolor/textures/bc7.h"

namespace voxkit::color {
namespace {

constexpr uint32_t batch_blocks = 256;  ///< that are encoded together

/// The colours of a part as an image: `image_side` rows of as many pixels. Where there is none stands the
/// last one, and behind the edges of the image what is there.
class Image {
 public:
  Image(std::span<const Rgb> colors, ImageCurve curve)
      : pixels_(size_t{image_side} * image_side, colors.back()) {
    for (uint32_t i = 0; i < colors.size(); ++i) {
      const Pixel at = curve_pixel(curve, i);
      pixels_[size_t{at.y} * image_side + at.x] = colors[i];
    }
  }
  Rgb at(uint32_t x, uint32_t y) const {
    return pixels_[size_t{std::min(y, image_side - 1)} * image_side + std::min(x, image_side - 1)];
  }
  /// A block, row by row.
  void copy(Pixel corner, BlockSize size, Rgb* out) const {
    for (uint32_t y = 0; y < size.height; ++y)
      for (uint32_t x = 0; x < size.width; ++x) *out++ = at(corner.x + x, corner.y + y);
  }

 private:
  std::vector<Rgb> pixels_;
};

/// 16 colours that follow each other, as they lie in their block.
Pixels16 block_of_16(std::span<const Rgb> colors, ImageCurve curve, uint32_t block) {
  Pixels16 pixels;
  for (uint32_t i = 16 * block; i < 16 * block + 16; ++i) {
    const Pixel at = curve_pixel(curve, i);
    // Behind the last colour comes that again.
    pixels[at.y % 4 * 4 + at.x % 4] = colors[std::min<size_t>(i, colors.size() - 1)];
  }
  return pixels;
}

void encode_as_astc(std::span<const Rgb> colors, const Options& options, const TextureLayout& layout,
                    std::byte* out) {
  const Image image(colors, options.image_curve);
  const BlockSize size = layout.size();
  const size_t block_pixels = size_t{size.width} * size.height;
  AstcEncoder encoder(size, options.effort);
  std::vector<Rgb> pixels(batch_blocks * block_pixels);
  for (uint32_t first = 0; first < layout.blocks(); first += batch_blocks) {
    const uint32_t count = std::min(batch_blocks, layout.blocks() - first);
    for (uint32_t i = 0; i < count; ++i)
      image.copy(layout.corner(first + i), size, &pixels[i * block_pixels]);
    encoder.encode(std::span(pixels).first(count * block_pixels), out + size_t{first} * astc_block_bytes);
  }
}

}  // namespace

uint32_t texture_block_bytes(ColorCodec codec) {
  return codec == ColorCodec::bc1   ? bc1_block_bytes
         : codec == ColorCodec::bc7 ? bc7_block_bytes
                                    : astc_block_bytes;
}

uint64_t texture_bytes(const Params& params, uint32_t colors) {
  return uint64_t{TextureLayout(params.image_curve, params.block_size, colors).blocks()} *
         texture_block_bytes(params.codec);
}

Status texture_support(ColorCodec codec) {
  return codec == ColorCodec::astc ? astc_support() : Status();
}

EncodedPart encode_texture(std::span<const Rgb> colors, const Options& options) {
  Params params;
  params.codec = options.codec;
  params.image_curve = options.image_curve;
  params.block_size = block_size_of(options);
  const auto count = static_cast<uint32_t>(colors.size());
  const TextureLayout layout(params.image_curve, params.block_size, count);
  EncodedPart part;
  part.blocks = layout.blocks();
  part.bytes.resize(texture_bytes(params, count));
  if (options.codec == ColorCodec::astc) {
    encode_as_astc(colors, options, layout, part.bytes.data());
  } else {
    for (uint32_t block = 0; block < layout.blocks(); ++block)
      (options.codec == ColorCodec::bc7 ? encode_bc7 : encode_bc1)(
          block_of_16(colors, options.image_curve, block), options.effort,
          &part.bytes[size_t{block} * texture_block_bytes(options.codec)]);
  }
  TextureReader reader;
  reader.open(part.bytes.data(), params, count);
  for (uint32_t i = 0; i < count; ++i) part.add_error(colors[i], reader.color(i));
  return part;
}

void TextureReader::open(const std::byte* bytes, const Params& params, uint32_t colors) {
  bytes_ = bytes;
  codec_ = params.codec;
  curve_ = params.image_curve;
  layout_ = TextureLayout(params.image_curve, params.block_size, colors);
  block_ = ~uint32_t{0};
}

uint32_t TextureReader::first_invalid() const {
  const auto valid = [&](uint32_t block) {
    return codec_ == ColorCodec::bc1   ? true
           : codec_ == ColorCodec::bc7 ? valid_bc7(bytes_of(block))
                                       : valid_astc(layout_.size(), bytes_of(block));
  };
  uint32_t block = 0;
  while (block < blocks() && valid(block)) ++block;
  return block;
}

void TextureReader::decode(uint32_t block) {
  if (codec_ == ColorCodec::astc) {
    decode_astc(layout_.size(), bytes_of(block), pixels_.data());
  } else {
    Pixels16 pixels;
    (codec_ == ColorCodec::bc7 ? decode_bc7 : decode_bc1)(bytes_of(block), pixels);
    std::copy(pixels.begin(), pixels.end(), pixels_.begin());
  }
  block_ = block;
}

std::string check_texture_part(std::span<const std::byte> part, const Params& params, uint32_t colors) {
  TextureReader reader;
  reader.open(part.data(), params, colors);
  const uint32_t invalid = reader.first_invalid();
  return invalid == reader.blocks() ? "" : fmt::format("block {}: not a valid one", invalid);
}

}  // namespace voxkit::color
