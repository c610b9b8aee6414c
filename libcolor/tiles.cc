#include "libcolor/tiles.h"

#include <array>

#include "formats/image/coded_image.h"
#include "libcolor/store.h"
#include "libcolor/textures/block_image.h"
#include "libcolor/textures/image_codec.h"
#include "libcolor/textures/part_image.h"
#include "libcolor/textures/texture.h"

namespace voxkit::color {
namespace {

struct Ending {
  std::string_view text;
  TileFormat format;
};
constexpr std::array<Ending, 6> endings = {{{".png", TileFormat::png},
                                            {".jpg", TileFormat::jpeg},
                                            {".jpeg", TileFormat::jpeg},
                                            {".jp2", TileFormat::jp2},
                                            {".dds", TileFormat::dds},
                                            {".astc", TileFormat::astc}}};

/// The codec whose parts are files of a format; nothing for blocks.
std::optional<ColorCodec> image_codec_of(TileFormat format) {
  switch (format) {
    case TileFormat::png:
      return ColorCodec::png;
    case TileFormat::jpeg:
      return ColorCodec::jpeg;
    case TileFormat::jp2:
      return ColorCodec::jp2;
    default:
      return std::nullopt;
  }
}

Result<BlockImage> blocks_of(std::span<const std::byte> file, TileFormat format, ImageCurve curve,
                             uint32_t colors) {
  const ImageSize size = part_image_size(curve, colors);
  return format == TileFormat::dds ? unpack_dds(file, size) : unpack_astc(file, size);
}

}  // namespace

std::optional<TileFormat> tile_format(std::string_view name) {
  for (const Ending& ending : endings)
    if (name.ends_with(ending.text)) return ending.format;
  return std::nullopt;
}

Status check_tile_format(TileFormat format, const Params& params) {
  if (const auto codec = image_codec_of(format)) return image_codec_support(image_format(*codec));
  if (format == TileFormat::dds && params.codec != ColorCodec::bc1 && params.codec != ColorCodec::bc7)
    return bad_usage("tiles as .dds are of bc1 or bc7 colors: expected .png, .jpg or .jp2");
  if (format == TileFormat::astc && params.codec != ColorCodec::astc)
    return bad_usage("tiles as .astc are of astc colors: expected .png, .jpg or .jp2");
  return {};
}

Result<std::vector<std::byte>> tile_of(const Volume& volume, uint64_t part, TileFormat format) {
  const Params& params = volume.params();
  const Store& store = volume.store();
  const uint32_t count = colors_of_part(params.color_count, part);
  const auto codec = image_codec_of(format);
  if (!codec || codec == params.codec) {
    const std::byte* const bytes = store.part(part, volume.container());
    if (bytes == nullptr) return tl::unexpected<Error>(store.status().error());
    const std::span stored(bytes, store.part_bytes(part));
    if (codec) return std::vector(stored.begin(), stored.end());
    const BlockImage image = block_image_of(stored, params, count);
    return format == TileFormat::dds ? pack_dds(image) : pack_astc(image);
  }
  ColorReader reader(store, volume.container(), params);
  std::vector<Rgb> colors;
  colors.reserve(count);
  for (uint32_t i = 0; i < count; ++i) colors.push_back(reader.color((part << part_log2) + i));
  VOX_CHECK(store.status());
  return encode_image(image_format(*codec), part_image(colors, params.image_curve), {100, 0, count});
}

Result<std::vector<Rgb>> colors_of_tile(std::span<const std::byte> file, TileFormat format, ImageCurve curve,
                                        uint32_t colors) {
  if (const auto codec = image_codec_of(format)) return decode_as_image(file, *codec, curve, colors);
  VOX_TRY(const BlockImage image, blocks_of(file, format, curve, colors));
  VOX_CHECK(texture_support(image.codec));
  VOX_TRY(const std::vector<std::byte> part, part_of(image, curve, colors));
  Params params;
  params.codec = image.codec;
  params.image_curve = curve;
  params.block_size = image.block_size;
  TextureReader reader;
  reader.open(part.data(), params, colors);
  std::vector<Rgb> out;
  out.reserve(colors);
  for (uint32_t i = 0; i < colors; ++i) out.push_back(reader.color(i));
  return out;
}

Result<std::optional<std::vector<std::byte>>> part_of_tile(std::span<const std::byte> file, TileFormat format,
                                                           const Options& options, uint32_t colors) {
  using Part = std::optional<std::vector<std::byte>>;
  if (const auto codec = image_codec_of(format)) {
    if (*codec != options.codec) return Part();
    VOX_CHECK(decode_as_image(file, *codec, options.image_curve, colors));
    return Part(std::in_place, file.begin(), file.end());
  }
  VOX_TRY(const BlockImage image, blocks_of(file, format, options.image_curve, colors));
  if (image.codec != options.codec || image.block_size != block_size_of(options)) return Part();
  VOX_TRY(std::vector<std::byte> part, part_of(image, options.image_curve, colors));
  return Part(std::move(part));
}

uint64_t tile_work_bytes(TileFormat format) {
  const auto codec = image_codec_of(format);
  // Of blocks: the part, the image of them, the file, and the colours.
  return codec ? image_part_work_bytes(*codec) : uint64_t{part_colors} * 6;
}

}  // namespace voxkit::color
