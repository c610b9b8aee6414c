#include "formats/image/image_input.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <functional>
#include <map>
#include <string_view>
#include <system_error>

#include "formats/image/image_check.h"

namespace voxkit {

using OIIO::ImageInput;
using OIIO::ImageSpec;

std::string one_line(std::string text) {
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
  return text.empty() ? "unreadable image" : text.substr(0, text.find('\n'));
}

std::string ending_of(const std::string& name) {
  const size_t dot = name.find_last_of("./");
  if (dot == std::string::npos || name[dot] == '/') return {};
  std::string ending = name.substr(dot + 1);
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return ending;
}

const char* image_format(const std::string& name) {
  static const std::map<std::string, const char*, std::less<>> formats = {
      {"tif", "tiff"}, {"tiff", "tiff"}, {"png", "png"},  {"exr", "openexr"},
      {"jpg", "jpeg"}, {"jpeg", "jpeg"}, {"bmp", "bmp"},  {"pgm", "pnm"},
      {"ppm", "pnm"},  {"pnm", "pnm"},   {"tga", "targa"}};
  const auto it = formats.find(ending_of(name));
  return it == formats.end() ? nullptr : it->second;
}

std::string describe(const ImageSpec& spec) {
  return fmt::format("{} x {} with {} channel{} of {}", spec.width, spec.height, spec.nchannels,
                     spec.nchannels == 1 ? "" : "s", spec.format.c_str());
}

void limit_image_size(const Context& ctx) {
  OIIO::attribute("limits:imagesize_MB",
                  static_cast<int>(std::clamp<uint64_t>(ctx.memory->limit() >> 21, 1, 1 << 30)));
}

Result<std::unique_ptr<ImageInput>> open_image(const std::string& path, uint64_t memory_limit) {
  const char* format = image_format(path);
  if (!format) return bad_input(path, "not an image that can be a slice: expected .tif, .png or .exr");
  struct stat state {};
  if (stat(path.c_str(), &state) != 0)
    return bad_input(path, fmt::format("cannot open: {}", std::generic_category().message(errno)));
  if (!S_ISREG(state.st_mode)) return bad_input(path, "not a regular file");
  if (std::string_view(format) == "png") VOX_CHECK(check_png(path));
  if (std::string_view(format) == "jpeg") VOX_CHECK(check_jpeg(path));
  if (std::string_view(format) == "openexr") VOX_CHECK(check_exr(path, memory_limit));
  auto input = ImageInput::create(format);
  if (!input) return bad_input(path, fmt::format("OpenImageIO was built without {}", format));
  input->threads(1);  // callers decode slices side by side
  ImageSpec spec, config;
  config.attribute("oiio:UnassociatedAlpha", 1);  // colours as they are in the file, not multiplied by alpha
  if (!input->open(path, spec, config)) {
    const std::string text = input->geterror();
    if (text.find("limits:imagesize_MB") != std::string::npos)
      return fail(ErrorCode::limit, path, "one image takes more than half of --max-memory");
    return bad_input(path, one_line(text));
  }
  if (spec.width < 1 || spec.height < 1) return bad_input(path, "image without pixels");
  // The library reads through a buffer of 256 rows, or of a TIFF strip, however few the image has.
  const int strip = std::max(0, spec.get_int_attribute("tiff:RowsPerStrip"));
  const uint64_t bytes = std::max<uint64_t>(
      spec.image_bytes(), unpacking_bytes(spec.scanline_bytes(), static_cast<uint64_t>(strip)));
  if (spec.image_bytes() / 65536 > static_cast<uint64_t>(state.st_size) + 16)
    return bad_input(path, fmt::format("header says {}: a file of {} bytes cannot hold that", describe(spec),
                                       static_cast<int64_t>(state.st_size)));
  VOX_CHECK(check_image_pixels(path, spec.width, spec.height));
  if (bytes > memory_limit / 2)
    return fail(
        ErrorCode::limit, path,
        fmt::format("one image takes {} bytes: more than half of --max-memory, {}", bytes, memory_limit));
  return input;
}

}  // namespace voxkit
