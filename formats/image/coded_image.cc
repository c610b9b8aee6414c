#include "formats/image/coded_image.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "formats/image/coded_image_module.h"

namespace voxkit {
namespace {

struct Library {
  const char* module;
  const char* name;
  const char* package;
  uint32_t work_bytes;  ///< a pixel
};

const Library& library(ImageFormat format) {
  static constexpr std::array<Library, 3> all = {{{"jpeg", "JPEG", "libjpeg-dev", 12},
                                                  {"jp2", "JPEG 2000", "libopenjp2-7-dev", 40},
                                                  {"png", "PNG", "libpng-dev", 16}}};
  return all[static_cast<size_t>(format)];
}

Result<const ImageCodec*> codec(ImageFormat format, ErrorCode missing) {
  const Library& l = library(format);
  VOX_TRY(const ModuleTable* const module,
          load_module({l.module, fmt::format("a {} image", l.name), l.package, missing}));
  return module->codec;
}

Result<const ImageQuantiser*> quantiser() {
  VOX_TRY(const ModuleTable* const module,
          load_module({"imagequant", "a palette of a PNG image", "libimagequant-dev", ErrorCode::usage}));
  return module->quantiser;
}

}  // namespace

Status image_codec_support(ImageFormat format) {
  VOX_CHECK(codec(format, ErrorCode::input));
  return {};
}

Status image_encoder_support(ImageFormat format, const ImageCoding& coding) {
  VOX_CHECK(codec(format, ErrorCode::usage));
  if (is_quantised(format, coding)) VOX_CHECK(quantiser());
  return {};
}

Result<std::vector<std::byte>> encode_image(ImageFormat format, const RgbImage& image,
                                            const ImageCoding& coding) {
  VOX_TRY(const ImageCodec* const table, codec(format, ErrorCode::usage));
  if (!is_quantised(format, coding)) return table->encode(image, coding);
  VOX_TRY(const ImageQuantiser* const palette, quantiser());
  RgbImage quantised = image;
  VOX_CHECK(palette->quantise(quantised, coding.palette == 0 ? 256 : coding.palette, coding.quality));
  return table->encode(quantised, coding);
}

Result<RgbImage> decode_image(ImageFormat format, std::span<const std::byte> file, ImageSize size) {
  VOX_TRY(const ImageCodec* const table, codec(format, ErrorCode::input));
  RgbImage image = make_rgb_image(size);
  if (const Status status = table->decode(file, image); !status)
    return fail(status.error().code, {},
                fmt::format("{} image: {}", library(format).name, status.error().what));
  return image;
}

uint64_t image_work_bytes(ImageFormat format, ImageSize size) {
  // Codecs work on whole blocks, and keep tables.
  return (uint64_t{1} << 20) + uint64_t{library(format).work_bytes} * (size.width + 63) * (size.height + 63);
}

}  // namespace voxkit
