#include "libcolor/textures/image_codec.h"

#include "libcolor/textures/part_image.h"

namespace voxkit::color {

ImageFormat image_format(ColorCodec codec) {
  return codec == ColorCodec::jpeg  ? ImageFormat::jpeg
         : codec == ColorCodec::jp2 ? ImageFormat::jp2
                                    : ImageFormat::png;
}

ImageCoding image_coding_of(const Options& options, uint64_t colors) {
  return {options.quality, options.codec == ColorCodec::png ? options.image_palette : 0, colors};
}

Result<EncodedPart> encode_as_image(std::span<const Rgb> colors, const Options& options) {
  EncodedPart part;
  VOX_TRY(part.bytes, encode_image(image_format(options.codec), part_image(colors, options.image_curve),
                                   image_coding_of(options, colors.size())));
  VOX_TRY(const std::vector<Rgb> decoded, decode_as_image(part.bytes, options.codec, options.image_curve,
                                                          static_cast<uint32_t>(colors.size())));
  for (size_t i = 0; i < colors.size(); ++i) part.add_error(colors[i], decoded[i]);
  return part;
}

Result<std::vector<Rgb>> decode_as_image(std::span<const std::byte> part, ColorCodec codec, ImageCurve curve,
                                         uint32_t colors) {
  VOX_TRY(const RgbImage image, decode_image(image_format(codec), part, part_image_size(curve, colors)));
  return part_colors_of(image, curve, colors);
}

uint64_t image_part_work_bytes(ColorCodec codec) {
  // Two images, and their colours.
  return image_work_bytes(image_format(codec), {image_side, image_side}) + uint64_t{9} * part_colors;
}

}  // namespace voxkit::color
