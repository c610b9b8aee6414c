#include "libcolor/part_codecs.h"

#include <iterator>

#include "libcolor/blocks/block_check.h"
#include "libcolor/blocks/block_encode.h"
#include "libcolor/palette/palette_check.h"
#include "libcolor/palette/palette_encode.h"
#include "libcolor/predicted/predicted.h"
#include "libcolor/textures/image_codec.h"
#include "libcolor/textures/texture.h"

namespace voxkit::color {
namespace {

using ColorsOfPart = std::span<const Rgb>;

Status always(const Options&) {
  return {};
}

Result<EncodedPart> encode_raw(ColorsOfPart colors, const Options&, const PartContext&) {
  static_assert(sizeof(Rgb) == 3);
  const auto raw = std::as_bytes(colors);
  EncodedPart part;
  part.bytes.assign(raw.begin(), raw.end());
  return part;
}
uint64_t raw_bytes(const Params&, uint32_t colors) {
  return uint64_t{colors} * sizeof(Rgb);
}

Result<EncodedPart> encode_blocks(ColorsOfPart colors, const Options& o, const PartContext&) {
  const int weight_bits = o.codec == ColorCodec::fws ? o.weight_bits : 0;
  return encode_part(colors, {o.threshold, weight_bits, o.effort, o.space});
}

Status supports_texture(const Options& o) {
  return texture_support(o.codec);
}
Result<EncodedPart> encode_as_texture(ColorsOfPart colors, const Options& o, const PartContext&) {
  return encode_texture(colors, o);
}

Result<EncodedPart> encode_palette(ColorsOfPart colors, const Options& o, const PartContext& context) {
  return encode_palette_part(colors, *context.palette, o.effort);
}
std::string check_palette(std::span<const std::byte> part, const Params& p, uint32_t colors) {
  const PaletteView view(part.data(), part.size(), colors, palette_bits(p.palette_colors));
  return check_palette_part(view, p.palette_colors);
}

Status supports_image(const Options& o) {
  return image_encoder_support(image_format(o.codec), image_coding_of(o, part_colors));
}
Result<EncodedPart> encode_image_part(ColorsOfPart colors, const Options& o, const PartContext&) {
  return encode_as_image(colors, o);
}

Status supports_predicted(const Options& o) {
  if (o.colors != Colors::leaf || o.curve != Curve::morton)
    return bad_usage(
        "colors predicted from the voxels around: expected those of voxels alone, in Morton order: leave out "
        "--colors and --curve");
  if (o.space != ErrorSpace::rgb)
    return bad_usage("predicted colors with a threshold in CIELAB: expected one in srgb");
  return {};
}
Result<EncodedPart> encode_as_predicted(ColorsOfPart colors, const Options& o, const PartContext& context) {
  return encode_predicted(colors, context.places, o.threshold);
}

/// By number, from 1 on.
constexpr PartCodec codecs[] = {
    {ColorCodec::raw, "raw", always, encode_raw, raw_bytes, nullptr},
    {ColorCodec::fws, "fws", always, encode_blocks, nullptr, check_block_part},
    {ColorCodec::vws, "vws", always, encode_blocks, nullptr, check_block_part},
    {ColorCodec::bc1, "bc1", supports_texture, encode_as_texture, texture_bytes, check_texture_part},
    {ColorCodec::astc, "astc", supports_texture, encode_as_texture, texture_bytes, check_texture_part},
    {ColorCodec::bc7, "bc7", supports_texture, encode_as_texture, texture_bytes, check_texture_part},
    {ColorCodec::palette, "palette", always, encode_palette, nullptr, check_palette},
    {ColorCodec::jpeg, "jpeg", supports_image, encode_image_part, nullptr, nullptr},
    {ColorCodec::jp2, "jp2", supports_image, encode_image_part, nullptr, nullptr},
    {ColorCodec::png, "png", supports_image, encode_image_part, nullptr, nullptr},
    {ColorCodec::predicted, "predicted", supports_predicted, encode_as_predicted, nullptr, nullptr},
};

constexpr bool in_order() {
  for (size_t i = 0; i < std::size(codecs); ++i)
    if (static_cast<size_t>(codecs[i].codec) != i + 1) return false;
  return true;
}
static_assert(in_order());

}  // namespace

const PartCodec& part_codec(ColorCodec codec) {
  return codecs[static_cast<size_t>(codec) - 1];
}

std::optional<ColorCodec> codec_named(std::string_view name) {
  for (const PartCodec& codec : codecs)
    if (codec.name == name) return codec.codec;
  return std::nullopt;
}

int most_codec_number() {
  return static_cast<int>(std::size(codecs));
}

}  // namespace voxkit::color
