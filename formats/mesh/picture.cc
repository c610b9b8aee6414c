#include "formats/mesh/picture.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "formats/image/image.h"
#include "formats/little_endian.h"
#include "formats/mapped_file.h"
#include "formats/mesh/mesh_module.h"
#include "formats/names.h"
#include "formats/parallel.h"

namespace voxkit {
namespace {

uint8_t byte_of(float value) {
  return static_cast<uint8_t>(std::lrint(value > 0 ? std::min(value, 255.0f) : 0.0f));
}

/// From linear light, 0..1, to sRGB, 0..255.
float encoded(float linear) {
  if (!(linear > 0.0031308f)) return 255 * 12.92f * linear;
  return 255 * (1.055f * std::pow(std::min(linear, 1.0f), 1 / 2.4f) - 0.055f);
}

/// A file that is there while this lives: OpenImageIO reads files of a known ending only.
class PictureFile {
 public:
  static Result<PictureFile> write(const std::string& name, std::span<const std::byte> bytes,
                                   const char* ending) {
    const char* folder = std::getenv("TMPDIR");
    PictureFile file;
    file.path_ = std::string(folder && *folder ? folder : "/tmp") + "/voxkit-XXXXXX" + ending;
    const int fd = mkstemps(file.path_.data(), static_cast<int>(std::strlen(ending)));
    if (fd < 0) {
      file.path_.clear();
      return bad_input(name, "cannot unpack an embedded texture: expected a folder to write to in $TMPDIR");
    }
    bool whole = true;
    while (whole && !bytes.empty()) {
      const ssize_t written = ::write(fd, bytes.data(), bytes.size());
      whole = written > 0;
      if (whole) bytes = bytes.subspan(static_cast<size_t>(written));
    }
    if (close(fd) != 0 || !whole)
      return bad_input(name, "cannot unpack an embedded texture: $TMPDIR is full");
    return file;
  }
  PictureFile(PictureFile&& other) noexcept { std::swap(path_, other.path_); }
  PictureFile& operator=(PictureFile&&) = delete;
  ~PictureFile() {
    if (!path_.empty()) unlink(path_.c_str());
  }
  const std::string& path() const { return path_; }

 private:
  PictureFile() = default;
  std::string path_;
};

bool starts_with(std::span<const std::byte> bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
}
bool is_webp(std::span<const std::byte> bytes) {
  return starts_with(bytes, "RIFF") && bytes.size() >= 12 && std::memcmp(bytes.data() + 8, "WEBP", 4) == 0;
}
uint64_t big_endian(const std::byte* at, int bytes) {
  uint64_t value = 0;
  for (int i = 0; i < bytes; ++i) value = value << 8 | std::to_integer<uint64_t>(at[i]);
  return value;
}

/// What the header of a PNG, JPEG, BMP or TGA file says of its sides, so that too large ones are refused
/// before anything reads on; of others, and of damaged ones, 1 x 1: their readers judge.
std::array<uint64_t, 2> sides_of(const std::string& name, std::span<const std::byte> bytes) {
  constexpr std::array<uint64_t, 2> unknown{1, 1};
  const std::byte* const at = bytes.data();
  if (starts_with(bytes, "\x89PNG") && bytes.size() >= 24)
    return {big_endian(at + 16, 4), big_endian(at + 20, 4)};
  if (starts_with(bytes, "BM") && bytes.size() >= 26) {
    const auto side = [&](size_t from) { return uint64_t{load_le<uint32_t>(at + from)}; };
    const uint64_t height = side(22);  // below 0: from top to bottom
    return {side(18), height > INT32_MAX ? (uint64_t{1} << 32) - height : height};
  }
  if (has_ending(name, ".tga") && bytes.size() >= 18)
    return {load_le<uint16_t>(at + 12), load_le<uint16_t>(at + 14)};
  if (!starts_with(bytes, "\xff\xd8")) return unknown;
  for (size_t i = 2; i + 9 <= bytes.size() && at[i] == std::byte{0xff};) {
    const auto marker = std::to_integer<unsigned>(at[i + 1]);
    if (marker == 0xff) {
      ++i;
      continue;
    }
    // A frame, of whatever coding: its height and width.
    if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc)
      return {big_endian(at + i + 7, 2), big_endian(at + i + 5, 2)};
    i += 2 + big_endian(at + i + 2, 2);
  }
  return unknown;
}

Result<Picture> decode_webp(const std::string& name, std::span<const std::byte> bytes, Context& ctx) {
  VOX_TRY(const ModuleTable* const module,
          load_module({"webp", "reading WebP textures", "libwebp-dev"}, name));
  return module->mesh->decode_webp(name, bytes, ctx);
}

}  // namespace

Status check_picture_size(const std::string& name, uint64_t width, uint64_t height) {
  constexpr auto side = static_cast<uint64_t>(max_picture_side);
  if (width < 1 || height < 1 || width > side || height > side ||
      width * height > uint64_t{max_picture_texels})
    return bad_input(name, fmt::format("a texture of {} x {} texels: expected 1 to {} a side and {} in all",
                                       width, height, max_picture_side, max_picture_texels));
  return {};
}

Result<Picture> plain_picture(int64_t width, int64_t height, uint32_t fill, Context& ctx) {
  Picture picture;
  picture.width = width;
  picture.height = height;
  picture.has_alpha = (fill >> 24) != 255;
  VOX_TRY(picture.texels, Buffer::allocate(static_cast<uint64_t>(width * height) * 4, "a texture", ctx));
  for (int64_t i = 0; i < width * height; ++i) std::memcpy(picture.data() + 4 * i, &fill, 4);
  return picture;
}

Result<Picture> read_picture(const std::string& path, Context& ctx) {
  {
    VOX_TRY(const auto file, MappedFile::open(path));
    if (is_webp(file->bytes())) return decode_webp(path, file->bytes(), ctx);
    const auto [width, height] = sides_of(path, file->bytes());
    VOX_CHECK(check_picture_size(path, width, height));
  }
  VOX_TRY(const auto read, read_image(path, ctx));
  if (!read) return bad_input(path, "a texture of several pages: expected one picture");
  const Image& image = *read;
  VOX_CHECK(
      check_picture_size(path, static_cast<uint64_t>(image.width()), static_cast<uint64_t>(image.height())));
  if (image.type() == SampleType::i8 || image.type() == SampleType::i16)
    return bad_input(path, "a texture of signed samples: expected unsigned ones, or floats");
  Picture picture;
  picture.width = image.width();
  picture.height = image.height();
  VOX_TRY(picture.texels, Buffer::allocate(static_cast<uint64_t>(image.pixels()) * 4, "a texture", ctx));
  const int channels = image.channels(), colors = image.colors();
  const bool linear = image.type() == SampleType::f32;
  const auto scale = static_cast<float>(255 / image.peak());
  for (int64_t y = 0; y < image.height(); ++y) {
    const float* in = image.row(y);
    uint8_t* out = picture.data() + 4 * y * image.width();
    for (int64_t x = 0; x < image.width(); ++x, in += channels, out += 4) {
      for (int c = 0; c < 3; ++c) {
        const float sample = in[colors == 3 ? c : 0];
        out[c] = byte_of(linear ? encoded(sample) : sample * scale);
      }
      out[3] = channels > colors ? byte_of(in[colors] * scale) : 255;
      picture.has_alpha |= out[3] != 255;
    }
  }
  return picture;
}

Result<Picture> decode_picture(const std::string& name, std::span<const std::byte> bytes, Context& ctx) {
  if (is_webp(bytes)) return decode_webp(name, bytes, ctx);
  if (starts_with(bytes, "\xabKTX 20"))
    return bad_input(name, "an embedded texture of KTX2, Basis Universal: expected PNG, JPEG or WebP");
  const char* ending = starts_with(bytes, "\x89PNG")        ? ".png"
                       : starts_with(bytes, "\xff\xd8\xff") ? ".jpg"
                                                            : nullptr;
  if (!ending) return bad_input(name, "an embedded texture of unknown format: expected PNG or JPEG, or WebP");
  VOX_TRY(const PictureFile file, PictureFile::write(name, bytes, ending));
  auto picture = read_picture(file.path(), ctx);
  if (!picture) return fail(picture.error().code, name, "an embedded texture: " + picture.error().what);
  return picture;
}

void adjust_colors(Picture& picture, float base, float gain) {
  std::array<uint8_t, 256> table;
  for (size_t i = 0; i < 256; ++i) table[i] = byte_of(255 * base + gain * static_cast<float>(i));
  for (int64_t i = 0; i < picture.width * picture.height; ++i)
    for (int64_t c = 0; c < 3; ++c) {
      uint8_t& value = picture.data()[4 * i + c];
      value = table[value];
    }
}

void set_opacity(Picture& picture, const Picture& mask, char channel) {
  picture.has_alpha = false;
  const char* const colors = "rgb";
  const char* const color = channel ? std::strchr(colors, channel) : nullptr;
  const bool by_alpha = channel == 'm' || (channel == 0 && mask.has_alpha);
  for (int64_t y = 0; y < picture.height; ++y)
    for (int64_t x = 0; x < picture.width; ++x) {
      const int64_t from_x = (2 * x + 1) * mask.width / (2 * picture.width),
                    from_y = (2 * y + 1) * mask.height / (2 * picture.height);
      const uint8_t* in = mask.data() + 4 * (from_y * mask.width + from_x);
      uint8_t& alpha = picture.data()[4 * (y * picture.width + x) + 3];
      // Weights of ITU-R BT.601 for the brightness of stored values, in 256ths.
      alpha = by_alpha ? in[3]
              : color  ? in[color - colors]
                       : static_cast<uint8_t>((77 * in[0] + 150 * in[1] + 29 * in[2] + 128) >> 8);
      picture.has_alpha |= alpha != 255;
    }
}

}  // namespace voxkit
