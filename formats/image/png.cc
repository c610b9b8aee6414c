// PNG by libpng. A module.
#include <fmt/format.h>
#include <png.h>

#include <cstring>
#include <optional>
#include <unordered_map>

#include "formats/image/coded_image_module.h"

namespace voxkit {
namespace {

constexpr size_t most_palette = 256;

/// An image as numbers of its colours, in the order in which they come.
struct Indexed {
  std::vector<png_byte> palette, pixels;
};

/// Nothing where there are too many colours.
std::optional<Indexed> indexed(const RgbImage& image) {
  Indexed out;
  out.pixels.reserve(image.rgb.size() / 3);
  std::unordered_map<uint32_t, png_byte> numbers;
  for (size_t i = 0; i < image.rgb.size(); i += 3) {
    png_byte rgb[3];
    std::memcpy(rgb, &image.rgb[i], 3);
    const auto next = static_cast<png_byte>(numbers.size());
    const auto [at, added] =
        numbers.try_emplace(static_cast<uint32_t>(rgb[0] | rgb[1] << 8 | rgb[2] << 16), next);
    if (numbers.size() > most_palette) return std::nullopt;
    if (added) out.palette.insert(out.palette.end(), rgb, rgb + 3);
    out.pixels.push_back(at->second);
  }
  return out;
}

Result<std::vector<std::byte>> encode(const RgbImage& image, const ImageCoding&) {
  png_image info{};
  info.version = PNG_IMAGE_VERSION;
  info.width = image.size.width;
  info.height = image.size.height;
  const auto table = indexed(image);
  info.format = table ? PNG_FORMAT_RGB_COLORMAP : PNG_FORMAT_RGB;
  if (table) info.colormap_entries = static_cast<png_uint_32>(table->palette.size() / 3);
  std::vector<std::byte> file(PNG_IMAGE_PNG_SIZE_MAX(info));
  png_alloc_size_t bytes = file.size();
  const void* const pixels = table ? static_cast<const void*>(table->pixels.data()) : image.rgb.data();
  if (png_image_write_to_memory(&info, file.data(), &bytes, 0, pixels, 0,
                                table ? table->palette.data() : nullptr) == 0)
    return fail(ErrorCode::internal, {}, info.message);
  file.resize(bytes);
  return file;
}

Status decode(std::span<const std::byte> file, RgbImage& image) {
  png_image info{};
  info.version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_memory(&info, file.data(), file.size()) == 0)
    return bad_input({}, info.message);
  const auto refuse = [&](const std::string& what) {
    png_image_free(&info);
    return bad_input({}, what);
  };
  if (ImageSize{info.width, info.height} != image.size)
    return refuse(fmt::format("{} x {} pixels: expected {} x {}", info.width, info.height, image.size.width,
                              image.size.height));
  if ((info.format & PNG_FORMAT_FLAG_ALPHA) != 0) return refuse("has alpha: expected RGB");
  if ((info.format & PNG_FORMAT_FLAG_LINEAR) != 0) return refuse("16 bits a component: expected 8");
  info.format = PNG_FORMAT_RGB;
  if (png_image_finish_read(&info, nullptr, image.rgb.data(), 0, nullptr) == 0)
    return bad_input({}, info.message);
  return {};
}

const ImageCodec codec{.encode = encode, .decode = decode};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.codec = &voxkit::codec)
