#include "formats/volume/tiff_pixels.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "formats/image/tiff_chunks.h"

namespace voxkit {
namespace {

constexpr int min_is_white = 0, min_is_black = 1, rgb = 2, palette = 3, mask = 4, ycbcr = 6;

/// Sample formats of the specification; 4, not defined, is read as unsigned.
constexpr int is_signed = 2, is_float = 3;

std::optional<SampleType> type_of(const TiffPage& page) {
  if (page.sample_format == is_float)
    return page.bits == 16   ? std::optional(SampleType::f16)
           : page.bits == 32 ? std::optional(SampleType::f32)
           : page.bits == 64 ? std::optional(SampleType::f64)
                             : std::nullopt;
  if (page.sample_format != 1 && page.sample_format != is_signed && page.sample_format != 4)
    return std::nullopt;
  const bool has_sign = page.sample_format == is_signed;
  if (page.bits == 1 && !has_sign) return SampleType::bit;
  if (page.bits >= 1 && page.bits <= 8) return has_sign ? SampleType::i8 : SampleType::u8;
  if (page.bits >= 9 && page.bits <= 16) return has_sign ? SampleType::i16 : SampleType::u16;
  if (page.bits >= 17 && page.bits <= 32) return has_sign ? SampleType::i32 : SampleType::u32;
  if (page.bits == 64) return has_sign ? SampleType::i64 : SampleType::u64;
  return std::nullopt;
}

std::string type_text(const TiffPage& page) {
  const char* const kinds[] = {"",          "unsigned",        "signed",       "float",
                               "undefined", "complex integer", "complex float"};
  const char* const kind =
      page.sample_format >= 1 && page.sample_format <= 6 ? kinds[page.sample_format] : "unknown";
  return fmt::format("{} bits, {}", page.bits, kind);
}

const char* photometric_text(int photometric) {
  switch (photometric) {
    case 5:
      return "inks (CMYK)";
    case ycbcr:
      return "YCbCr";
    case 8:
    case 9:
    case 10:
      return "L*a*b*";
    case 32803:
      return "a mosaic of colours (CFA)";
    case 32844:
    case 32845:
      return "LogLuv";
    default:
      return "of an unknown kind";
  }
}

/// The entries of a palette as 16 bits, reds, greens and blues one after the other. Some writers put 8 bits.
std::vector<uint16_t> palette_of(const TiffFile& file, const TiffPage& page) {
  const size_t entries = size_t{1} << page.bits;
  std::vector<uint16_t> colors(3 * entries);
  for (size_t i = 0; i < colors.size(); ++i) colors[i] = static_cast<uint16_t>(file.number(page.colors, i));
  if (std::all_of(colors.begin(), colors.end(), [](uint16_t v) { return v < 256; }))
    for (uint16_t& v : colors) v = static_cast<uint16_t>(v * 257);
  return colors;
}

struct PaletteKind {
  bool grey = true, bytes = true;  ///< three times the same; 8 bits say all
};
PaletteKind kind_of(const std::vector<uint16_t>& colors) {
  const size_t entries = colors.size() / 3;
  PaletteKind kind;
  for (size_t i = 0; i < entries; ++i)
    kind.grey &= colors[i] == colors[entries + i] && colors[i] == colors[2 * entries + i];
  for (const uint16_t v : colors) kind.bytes &= (v & 0xff) == 0 || (v & 0xff) == v >> 8;
  return kind;
}

/// Bytes of a sample once it is unpacked.
int unpacked_bytes(const TiffPage& page) {
  return page.bits <= 8 ? 1 : page.bits <= 16 ? 2 : page.bits <= 32 ? 4 : 8;
}
bool is_packed(const TiffPage& page) {
  return page.bits != 8 && page.bits != 16 && page.bits != 32 && page.bits != 64;
}

/// Samples of any number of bits up to 32, the highest bit first, as integers of the next whole type.
template <class T>
void unpack_row(const std::byte* in, int bits, bool has_sign, int64_t count, T* out) {
  uint64_t held = 0;
  int have = 0;
  const uint64_t keep = (uint64_t{1} << bits) - 1;
  const uint64_t sign = has_sign ? uint64_t{1} << (bits - 1) : 0;
  for (int64_t i = 0; i < count; ++i) {
    while (have < bits) {
      held = held << 8 | std::to_integer<uint64_t>(*in++);
      have += 8;
    }
    const uint64_t value = held >> (have - bits) & keep;
    have -= bits;
    out[i] = static_cast<T>((value ^ sign) - sign);
  }
}

/// 24 bits: whole bytes, which have been put in the order of this machine.
void unpack_row_24(const std::byte* in, bool has_sign, int64_t count, uint32_t* out) {
  const uint32_t sign = has_sign ? 1u << 23 : 0;
  for (int64_t i = 0; i < count; ++i, in += 3) {
    const uint32_t value = std::to_integer<uint32_t>(in[0]) | std::to_integer<uint32_t>(in[1]) << 8 |
                           std::to_integer<uint32_t>(in[2]) << 16;
    out[i] = (value ^ sign) - sign;
  }
}

/// Reads rows by unpacking the strips or tiles that they meet.
class Reader {
 public:
  Reader(const TiffFile& file, const TiffPage& page, const TiffPixels& pixels, uint64_t moved)
      : file_(file), page_(page), pixels_(pixels), moved_(moved), sample_bytes_(unpacked_bytes(page)) {}

  Status read(int64_t z, int64_t y0, int64_t y1, std::byte* out) {
    const auto layout = tiff_chunk_layout(page_);
    if (!layout) return bad_input(file_.name(), "corrupt TIFF file: its tiles are too large");
    layout_ = *layout;
    out_ = out, y0_ = y0, y1_ = y1;
    const auto up = [](int64_t a, int64_t b) { return (a + b - 1) / b; };
    const int64_t across = up(page_.width, page_.chunk_width), down = up(page_.height, page_.chunk_height),
                  deep = up(page_.depth, page_.chunk_depth);
    const int planes = page_.planar == 2 ? page_.samples : 1;
    for (int plane = 0; plane < planes; ++plane) {
      if (planes > 1 && (plane < pixels_.first || plane >= pixels_.first + pixels_.count)) continue;
      for (int64_t j = y0 / page_.chunk_height; j * page_.chunk_height < y1; ++j)
        for (int64_t i = 0; i < across; ++i) {
          const int64_t chunk = ((plane * deep + z / page_.chunk_depth) * down + j) * across + i;
          VOX_CHECK(read_chunk(static_cast<uint64_t>(chunk), i * page_.chunk_width, j * page_.chunk_height,
                               z % page_.chunk_depth, planes > 1 ? plane - pixels_.first : -1));
        }
    }
    return {};
  }

 private:
  /// Copies what is wanted of a strip or tile at x, y. `place`: of its only sample among those that are
  /// taken; -1 where it has all of them.
  Status read_chunk(uint64_t chunk, int64_t x, int64_t y, int64_t z, int place) {
    const int64_t rows = page_.tiled ? page_.chunk_height : std::min(page_.chunk_height, page_.height - y);
    const int64_t first = std::max(y0_, y), last = std::min({y1_, y + rows, page_.height});
    const int64_t width = std::min(page_.chunk_width, page_.width - x);
    const auto row_bytes = static_cast<int64_t>(layout_.row_bytes);
    // No more is unpacked than is wanted, and than the last strip has.
    const int64_t slice_rows = page_.tiled ? page_.chunk_height : 0;
    chunk_.resize(static_cast<size_t>((z * slice_rows + (last - y)) * row_bytes));
    VOX_CHECK(unpack_tiff_chunk(file_, page_, chunk, chunk_, moved_));
    const int samples = layout_.samples;
    const size_t row_samples = static_cast<size_t>(page_.chunk_width) * static_cast<size_t>(samples);
    if (is_packed(page_)) row_.resize(row_samples * static_cast<size_t>(sample_bytes_));
    const int from = place >= 0 ? 0 : pixels_.first, count = place >= 0 ? 1 : pixels_.count;
    const int64_t out_pixel = int64_t{pixels_.count} * sample_bytes_, in_pixel = samples * sample_bytes_;
    for (int64_t row = first; row < last; ++row) {
      const std::byte* in = chunk_.data() + (z * slice_rows + (row - y)) * row_bytes;
      if (is_packed(page_)) {
        unpack(in, static_cast<int64_t>(row_samples));
        in = row_.data();
      }
      std::byte* out =
          out_ + ((row - y0_) * page_.width + x) * out_pixel + std::max(place, 0) * sample_bytes_;
      in += from * sample_bytes_;
      const auto bytes = static_cast<size_t>(count * sample_bytes_);
      if (in_pixel == out_pixel && static_cast<int64_t>(bytes) == in_pixel) {
        std::memcpy(out, in, static_cast<size_t>(width) * bytes);
        continue;
      }
      for (int64_t i = 0; i < width; ++i) std::memcpy(out + i * out_pixel, in + i * in_pixel, bytes);
    }
    return {};
  }

  void unpack(const std::byte* in, int64_t count) {
    const bool has_sign = page_.sample_format == is_signed;
    if (page_.bits == 24)
      unpack_row_24(in, has_sign, count, reinterpret_cast<uint32_t*>(row_.data()));
    else if (sample_bytes_ == 1)
      unpack_row(in, page_.bits, has_sign, count, reinterpret_cast<uint8_t*>(row_.data()));
    else if (sample_bytes_ == 2)
      unpack_row(in, page_.bits, has_sign, count, reinterpret_cast<uint16_t*>(row_.data()));
    else
      unpack_row(in, page_.bits, has_sign, count, reinterpret_cast<uint32_t*>(row_.data()));
  }

  const TiffFile& file_;
  const TiffPage& page_;
  const TiffPixels& pixels_;
  uint64_t moved_;
  int sample_bytes_;
  TiffChunkLayout layout_;
  std::byte* out_ = nullptr;
  int64_t y0_ = 0, y1_ = 0;
  std::vector<std::byte> chunk_, row_;
};

/// Indices become what the palette has for them.
void look_up(const TiffFile& file, const TiffPage& page, const TiffPixels& pixels, const std::byte* indices,
             int64_t count, std::byte* out) {
  const std::vector<uint16_t> colors = palette_of(file, page);
  const size_t entries = colors.size() / 3;
  for (int64_t i = 0; i < count; ++i) {
    size_t index = std::to_integer<size_t>(indices[page.bits > 8 ? 2 * i : i]);
    if (page.bits > 8) index |= std::to_integer<size_t>(indices[2 * i + 1]) << 8;
    if (pixels.layout.components == 3) {
      for (size_t c = 0; c < 3; ++c)
        out[3 * i + static_cast<int64_t>(c)] = static_cast<std::byte>(colors[c * entries + index] >> 8);
    } else if (pixels.layout.type == SampleType::u16) {
      std::memcpy(out + 2 * i, &colors[index], 2);
    } else {
      out[i] = static_cast<std::byte>(colors[index] >> 8);
    }
  }
}

}  // namespace

bool is_tiff_color(const TiffPage& page) {
  return (page.photometric == rgb || page.photometric == ycbcr) && page.bits == 8 &&
         page.sample_format != is_signed && (page.samples == 3 || page.samples == 4);
}

Result<TiffPixels> tiff_pixels(const TiffFile& file, const TiffPage& page, int sample,
                               const OpenOptions& options) {
  const auto refused = [&](const std::string& what) {
    return bad_input(file.name(), fmt::format("page {} {}", page.number, what));
  };
  TiffPixels pixels;
  if (page.width < 1 || page.height < 1 || page.depth < 1) return refused("is an image without pixels");
  if (page.width > INT32_MAX || page.height > INT32_MAX || page.depth > INT32_MAX || page.samples < 1 ||
      page.samples > 65535 || page.bits < 1 || page.bits > 128)
    return refused(fmt::format("is {} x {} with {} samples of {} bits: expected sides below 2^31", page.width,
                               page.height, page.samples, page.bits));
  if (page.chunk_width < 1 || page.chunk_height < 1 || page.chunk_depth < 1)
    return refused("has tiles without pixels");
  if (!page.same_bits) return refused("has samples of several sizes: expected one for all");
  pixels.by_library = !unpacks_tiff(page.compression);
  const bool jpeg = page.compression == 7, fax = page.compression >= 2 && page.compression <= 4;
  const bool known = jpeg || fax || page.compression == 34925 || page.compression == 50001;
  if (pixels.by_library && !known)
    return refused(
        fmt::format("has the compression {}: expected none, LZW, Deflate, PackBits, Zstandard, "
                    "JPEG, CCITT, LZMA or WebP",
                    tiff_compression_name(page.compression)));
  if (pixels.by_library && page.depth > 1)
    return refused(fmt::format("has {} slices with the compression {}: expected LZW or Deflate", page.depth,
                               tiff_compression_name(page.compression)));
  const auto type = type_of(page);
  if (!type)
    return refused(
        fmt::format("has samples of {}: expected integers of 1 to 32 or 64 bits, or floats of 16, "
                    "32 or 64",
                    type_text(page)));
  const bool whole = !is_packed(page);
  if (page.predictor != 1 && !pixels.by_library && !(page.predictor == 2 && whole) &&
      !(page.predictor == 3 && page.sample_format == is_float))
    return refused(
        fmt::format("has the predictor {} with samples of {}: expected none, or one of whole bytes",
                    page.predictor, type_text(page)));
  if (page.planar != 1 && page.planar != 2)
    return refused(fmt::format("has the planar configuration {}: expected 1 or 2", page.planar));
  if (page.orientation < 1 || page.orientation > 8)
    return refused(fmt::format("has the orientation {}: expected 1 to 8", page.orientation));
  if (!page.tiled && page.depth > 1 && page.chunk_height < page.height &&
      page.height % page.chunk_height != 0)
    return refused("has slices in strips that do not end with them: expected tiles");

  pixels.layout.type = *type == SampleType::bit ? SampleType::u8 : *type;
  pixels.sample_type = *type;
  pixels.format = scalar_format(*type);
  pixels.first = sample;
  if (page.photometric == palette) {
    if (page.samples != 1 || page.bits > 16 || page.sample_format == is_float)
      return refused("has a palette with several samples: expected one of up to 16 bits");
    if (options.labels) {
      if (pixels.by_library) return refused("has a palette in a compression whose indices are not read");
      return pixels;
    }
    if (page.colors.count != uint64_t{3} << page.bits || page.colors.type != 3)
      return refused("has a palette of the wrong size");
    pixels.layout = {SampleType::u8, 3, false};
    const PaletteKind kind = kind_of(palette_of(file, page));
    pixels.colors = !pixels.by_library;
    pixels.sample_type = kind.bytes ? SampleType::u8 : SampleType::u16;
    if (kind.grey && !pixels.by_library) pixels.layout = {pixels.sample_type, 1, false};
    pixels.format = pixels.layout.components == 3 ? VoxelFormat::rgb24 : scalar_format(pixels.sample_type);
    if (pixels.layout.components == 3) pixels.sample_type = SampleType::u8;
    return pixels;
  }
  if (is_tiff_color(page) && !(page.photometric == ycbcr && !jpeg) && !options.channel) {
    pixels.first = 0;
    pixels.count = pixels.layout.components = page.samples;
    pixels.format = page.samples == 3 ? VoxelFormat::rgb24 : VoxelFormat::rgba32;
    pixels.divides_alpha = page.samples == 4 && page.extra == 1;
    return pixels;
  }
  if (page.photometric != min_is_white && page.photometric != min_is_black && page.photometric != rgb &&
      page.photometric != mask && page.photometric != 34892 && !(page.photometric == ycbcr && jpeg))
    return refused(fmt::format("has pixels that are {}: expected grey, RGB or a palette",
                               photometric_text(page.photometric)));
  return pixels;
}

Status read_tiff_rows(const TiffFile& file, const TiffPage& page, const TiffPixels& pixels, int64_t z,
                      int64_t y0, int64_t y1, std::byte* out, uint64_t moved) {
  const int64_t count = (y1 - y0) * page.width;
  Reader reader(file, page, pixels, moved);
  if (!pixels.colors) {
    VOX_CHECK(reader.read(z, y0, y1, out));
  } else {
    std::vector<std::byte> indices(static_cast<size_t>(count * (page.bits > 8 ? 2 : 1)));
    VOX_CHECK(reader.read(z, y0, y1, indices.data()));
    look_up(file, page, pixels, indices.data(), count, out);
  }
  if (pixels.divides_alpha)
    for (int64_t i = 0; i < count; ++i) {
      const unsigned alpha = std::to_integer<unsigned>(out[4 * i + 3]);
      for (int64_t c = 0; alpha > 0 && c < 3; ++c) {
        const unsigned v = std::to_integer<unsigned>(out[4 * i + c]);
        out[4 * i + c] = static_cast<std::byte>(std::min(255u, (v * 255 + alpha / 2) / alpha));
      }
    }
  return {};
}

std::string describe(const TiffPage& page) {
  const auto type = type_of(page);
  return fmt::format("{} x {} with {} channel{} of {}", page.width, page.height, page.samples,
                     page.samples == 1 ? "" : "s", type ? std::string(name(*type)) : type_text(page));
}

}  // namespace voxkit
