#include "formats/mesh/texture.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <vector>

#include "formats/image/image.h"
#include "formats/names.h"
#include "formats/parallel.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;

uint8_t byte_of(float value) {
  return static_cast<uint8_t>(std::lrint(value > 0 ? std::min(value, 255.0f) : 0.0f));
}

/// From linear light, 0..1, to sRGB, 0..255.
float encoded(float linear) {
  if (!(linear > 0.0031308f)) return 255 * 12.92f * linear;
  return 255 * (1.055f * std::pow(std::min(linear, 1.0f), 1 / 2.4f) - 0.055f);
}

/// A file that is there while this lives: OpenImageIO reads files of a known ending only.
class TemporaryFile {
 public:
  static Result<TemporaryFile> write(const std::string& name, std::span<const std::byte> bytes,
                                     const char* ending) {
    const char* folder = std::getenv("TMPDIR");
    TemporaryFile file;
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
  TemporaryFile(TemporaryFile&& other) noexcept { std::swap(path_, other.path_); }
  TemporaryFile& operator=(TemporaryFile&&) = delete;
  ~TemporaryFile() {
    if (!path_.empty()) unlink(path_.c_str());
  }
  const std::string& path() const { return path_; }

 private:
  TemporaryFile() = default;
  std::string path_;
};

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

/// Whether there is a file; follows links.
bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

/// The file that a path means where upper and lower case are the same; empty where there is none.
fs::path find_in_any_case(const fs::path& path) {
  std::error_code error;
  fs::path found = path.is_absolute() ? path.root_path() : fs::path(".");
  for (const fs::path& part : path.relative_path()) {
    if (fs::exists(found / part, error)) {
      found /= part;
      continue;
    }
    const std::string wanted = lower(part.string());
    std::vector<std::string> matches;
    for (fs::directory_iterator it(found, error), end; !error && it != end; it.increment(error))
      if (std::string name = it->path().filename().string(); lower(name) == wanted)
        matches.push_back(std::move(name));
    if (matches.empty()) return {};
    found /= *std::min_element(matches.begin(), matches.end());  // folders list their files in any order
  }
  return is_file(found) ? found : fs::path{};
}

/// %20 and the like become the characters that they mean.
std::string unescaped(const std::string& text) {
  std::string plain;
  for (size_t i = 0; i < text.size(); ++i) {
    const auto digit = [&](size_t at) {
      return at < text.size() && std::isxdigit(static_cast<unsigned char>(text[at]));
    };
    if (text[i] == '%' && digit(i + 1) && digit(i + 2)) {
      plain += static_cast<char>(std::stoi(text.substr(i + 1, 2), nullptr, 16));
      i += 2;
    } else {
      plain += text[i];
    }
  }
  return plain;
}

}  // namespace

Result<Texture> plain_texture(int64_t width, int64_t height, uint32_t fill, Context& ctx) {
  Texture texture;
  texture.width = width;
  texture.height = height;
  texture.has_alpha = (fill >> 24) != 255;
  VOX_TRY(texture.texels, Buffer::allocate(static_cast<uint64_t>(width * height) * 4, "a texture", ctx));
  for (int64_t i = 0; i < width * height; ++i) std::memcpy(texture.data() + 4 * i, &fill, 4);
  return texture;
}

Result<Texture> read_texture(const std::string& path, Context& ctx) {
  VOX_TRY(const auto read, read_image(path, ctx));
  if (!read) return bad_input(path, "a texture of several pages: expected one picture");
  const Image& image = *read;
  if (image.width() > max_texture_side || image.height() > max_texture_side)
    return bad_input(path, fmt::format("a texture of {} x {} texels: expected {} a side at most",
                                       image.width(), image.height(), max_texture_side));
  if (image.type() == SampleType::i8 || image.type() == SampleType::i16)
    return bad_input(path, "a texture of signed samples: expected unsigned ones, or floats");
  Texture texture;
  texture.width = image.width();
  texture.height = image.height();
  VOX_TRY(texture.texels, Buffer::allocate(static_cast<uint64_t>(image.pixels()) * 4, "a texture", ctx));
  const int channels = image.channels(), colours = image.colours();
  const bool linear = image.type() == SampleType::f32;
  const auto scale = static_cast<float>(255 / image.peak());
  for (int64_t y = 0; y < image.height(); ++y) {
    const float* in = image.row(y);
    uint8_t* out = texture.data() + 4 * y * image.width();
    for (int64_t x = 0; x < image.width(); ++x, in += channels, out += 4) {
      for (int c = 0; c < 3; ++c) {
        const float sample = in[colours == 3 ? c : 0];
        out[c] = byte_of(linear ? encoded(sample) : sample * scale);
      }
      out[3] = channels > colours ? byte_of(in[colours] * scale) : 255;
      texture.has_alpha |= out[3] != 255;
    }
  }
  return texture;
}

Result<Texture> decode_texture(const std::string& name, std::span<const std::byte> bytes, Context& ctx) {
  const auto starts = [&](std::string_view magic) {
    return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
  };
  const char* ending = starts("\x89PNG") ? ".png" : starts("\xff\xd8\xff") ? ".jpg" : nullptr;
  if (!ending) return bad_input(name, "an embedded texture of unknown format: expected PNG or JPEG");
  VOX_TRY(const TemporaryFile file, TemporaryFile::write(name, bytes, ending));
  auto texture = read_texture(file.path(), ctx);
  if (!texture) return fail(texture.error().code, name, "an embedded texture: " + texture.error().what);
  return texture;
}

void set_opacity(Texture& texture, const Texture& mask) {
  texture.has_alpha = false;
  for (int64_t y = 0; y < texture.height; ++y)
    for (int64_t x = 0; x < texture.width; ++x) {
      const int64_t from_x = (2 * x + 1) * mask.width / (2 * texture.width),
                    from_y = (2 * y + 1) * mask.height / (2 * texture.height);
      const uint8_t* in = mask.data() + 4 * (from_y * mask.width + from_x);
      uint8_t& alpha = texture.data()[4 * (y * texture.width + x) + 3];
      // Weights of ITU-R BT.601 for the brightness of stored values, in 256ths.
      alpha =
          mask.has_alpha ? in[3] : static_cast<uint8_t>((77 * in[0] + 150 * in[1] + 29 * in[2] + 128) >> 8);
      texture.has_alpha |= alpha != 255;
    }
}

std::string find_texture(const std::string& folder, const std::string& name) {
  std::string slashes = name;
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  const fs::path base(folder);
  for (const std::string& written : {slashes, unescaped(slashes)}) {
    if (written.empty() || written.find('\0') != std::string::npos) continue;
    for (const fs::path& path : {base / written, base / fs::path(written).filename()}) {
      if (is_file(path)) return path.string();
      if (const fs::path found = find_in_any_case(path); !found.empty()) return found.string();
    }
  }
  return {};
}

}  // namespace voxkit
