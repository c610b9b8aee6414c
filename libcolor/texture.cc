#include "libcolor/texture.h"

#include <algorithm>

#include "libcolor/bc1.h"

namespace voxkit::color {

uint64_t texture_bytes(const Params&, uint32_t colors) {
  return (uint64_t{colors} + 15) / 16 * bc1_block_bytes;
}

EncodedPart encode_texture(std::span<const Rgb> colors, const Options& options) {
  Params params;
  params.codec = options.codec;
  params.image_curve = options.image_curve;
  EncodedPart part;
  part.bytes.resize(texture_bytes(params, static_cast<uint32_t>(colors.size())));
  part.blocks = part.bytes.size() / bc1_block_bytes;
  for (uint32_t block = 0; block < part.blocks; ++block) {
    Pixels16 pixels;
    for (uint32_t i = 16 * block; i < 16 * block + 16; ++i) {
      const Pixel at = curve_pixel(options.image_curve, i);
      // Behind the last colour comes that again.
      pixels[at.y % 4 * 4 + at.x % 4] = colors[std::min<size_t>(i, colors.size() - 1)];
    }
    encode_bc1(pixels, options.effort, &part.bytes[block * bc1_block_bytes]);
  }
  TextureReader reader;
  reader.open(part.bytes.data(), params);
  for (uint32_t i = 0; i < colors.size(); ++i) part.add_error(colors[i], reader.color(i));
  return part;
}

void TextureReader::decode(uint32_t block) {
  decode_bc1(bytes_ + uint64_t{block} * bc1_block_bytes, pixels_);
  block_ = block;
  ++decoded_;
}

}  // namespace voxkit::color
