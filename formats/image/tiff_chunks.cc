#include "formats/image/tiff_chunks.h"

#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <vector>

namespace voxkit {
namespace {

bool unpack_bits(std::span<const std::byte> in, std::span<std::byte> out) {
  size_t at = 0, done = 0;
  while (done < out.size()) {
    if (at >= in.size()) return false;
    const int control = static_cast<int8_t>(in[at++]);
    if (control == -128) continue;
    const size_t count =
        std::min<size_t>(control >= 0 ? static_cast<size_t>(control) + 1 : static_cast<size_t>(1 - control),
                         out.size() - done);
    if (control >= 0) {
      if (static_cast<size_t>(control) + 1 > in.size() - at) return false;
      std::memcpy(&out[done], &in[at], count);
      at += static_cast<size_t>(control) + 1;
    } else {
      if (at >= in.size()) return false;
      std::memset(&out[done], std::to_integer<int>(in[at++]), count);
    }
    done += count;
  }
  return true;
}

/// Codes of 9 to 12 bits, the highest bit first, each the number of a string that came before and is a byte
/// longer than another; a string is where it was written last.
bool unpack_lzw(std::span<const std::byte> in, std::span<std::byte> out) {
  constexpr unsigned clear = 256, end = 257, first_free = 258, most = 4096;
  struct Entry {
    size_t at = 0, length = 0;  // in `out`
  };
  std::vector<Entry> table(most);
  unsigned next = first_free, width = 9;
  Entry last;
  uint32_t bits = 0;
  unsigned held = 0;
  size_t at = 0, done = 0;
  while (done < out.size()) {
    while (held < width) {
      if (at >= in.size()) return false;
      bits = bits << 8 | std::to_integer<uint32_t>(in[at++]);
      held += 8;
    }
    const unsigned code = bits >> (held - width) & ((1u << width) - 1);
    held -= width;
    if (code == end) return false;
    if (code == clear) {
      next = first_free, width = 9;
      last = {};
      continue;
    }
    const Entry now{done, 0};
    size_t length = 1;
    if (code < clear) {
      out[done++] = static_cast<std::byte>(code);
    } else {
      if (last.length == 0 || code > next || (code == next && next >= most)) return false;
      // A string that is being entered now is the last one and its first byte.
      const Entry from = code == next ? Entry{last.at, last.length + 1} : table[code];
      length = from.length;
      const size_t count = std::min(length, out.size() - done);
      for (size_t i = 0; i < count; ++i) out[done + i] = out[from.at + i];  // may overlap
      done += count;
    }
    if (last.length != 0 && next < most) table[next++] = {last.at, last.length + 1};
    last = {now.at, length};
    if (next + 1 >= (1u << width) && width < 12) ++width;
  }
  return true;
}

bool inflate_all(std::span<const std::byte> in, std::span<std::byte> out) {
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) return false;
  size_t taken = 0, done = 0;
  int state = Z_OK;
  while (done < out.size() && state == Z_OK) {
    const auto give = static_cast<uInt>(std::min<size_t>(in.size() - taken, 1u << 30));
    const auto room = static_cast<uInt>(std::min<size_t>(out.size() - done, 1u << 30));
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(in.data() + taken));
    stream.avail_in = give;
    stream.next_out = reinterpret_cast<Bytef*>(out.data() + done);
    stream.avail_out = room;
    state = inflate(&stream, Z_NO_FLUSH);
    taken += give - stream.avail_in;
    done += room - stream.avail_out;
    if (state == Z_OK && stream.avail_in == give && stream.avail_out == room) break;
  }
  inflateEnd(&stream);
  return done == out.size();
}

bool unpack_zstd(std::span<const std::byte> in, std::span<std::byte> out) {
  ZSTD_DStream* const stream = ZSTD_createDStream();
  if (!stream) return false;
  ZSTD_inBuffer from{in.data(), in.size(), 0};
  ZSTD_outBuffer to{out.data(), out.size(), 0};
  while (to.pos < to.size) {
    const size_t before = from.pos + to.pos;
    const size_t state = ZSTD_decompressStream(stream, &to, &from);
    if (ZSTD_isError(state) || from.pos + to.pos == before) break;
  }
  ZSTD_freeDStream(stream);
  return to.pos == to.size;
}

template <class T>
void swap_all(std::span<std::byte> bytes) {
  for (size_t i = 0; i + sizeof(T) <= bytes.size(); i += sizeof(T))
    std::reverse(bytes.begin() + static_cast<ptrdiff_t>(i),
                 bytes.begin() + static_cast<ptrdiff_t>(i + sizeof(T)));
}

/// Sums of the differences that each row has; modulo the size of a sample.
template <class T>
void add_differences(std::span<std::byte> row, size_t stride) {
  const size_t count = row.size() / sizeof(T);
  for (size_t i = stride; i < count; ++i) {
    T left, value;
    std::memcpy(&left, &row[(i - stride) * sizeof(T)], sizeof(T));
    std::memcpy(&value, &row[i * sizeof(T)], sizeof(T));
    value = static_cast<T>(value + left);
    std::memcpy(&row[i * sizeof(T)], &value, sizeof(T));
  }
}

/// The bytes of a row's floats by their place in a float, the highest first, as differences.
void add_float_differences(std::span<std::byte> row, size_t stride, size_t sample_bytes) {
  add_differences<uint8_t>(row, stride);
  const std::vector<std::byte> planes(row.begin(), row.end());
  const size_t count = row.size() / sample_bytes;
  for (size_t i = 0; i < count; ++i)
    for (size_t b = 0; b < sample_bytes; ++b)
      row[i * sample_bytes + (sample_bytes - 1 - b)] = planes[b * count + i];
}

std::byte reversed(std::byte b) {
  auto v = std::to_integer<unsigned>(b);
  v = (v & 0x0f) << 4 | v >> 4;
  v = (v & 0x33) << 2 | (v >> 2 & 0x33);
  v = (v & 0x55) << 1 | (v >> 1 & 0x55);
  return static_cast<std::byte>(v);
}

}  // namespace

bool unpacks_tiff(int compression) {
  return compression == 1 || compression == 5 || compression == 8 || compression == 32946 ||
         compression == 32773 || compression == 50000;
}

std::optional<TiffChunkLayout> tiff_chunk_layout(const TiffPage& page) {
  TiffChunkLayout layout;
  layout.samples = page.planar == 2 ? 1 : page.samples;
  // A strip holds no more rows than the image has; of slices of a page without tiles, all of them.
  const uint64_t rows = page.tiled ? static_cast<uint64_t>(page.chunk_height)
                                   : static_cast<uint64_t>(std::min(page.chunk_height, page.height));
  uint64_t bits = 0;
  if (__builtin_mul_overflow(static_cast<uint64_t>(page.chunk_width),
                             static_cast<uint64_t>(layout.samples) * static_cast<uint64_t>(page.bits),
                             &bits) ||
      bits > UINT64_MAX - 7)
    return std::nullopt;
  layout.row_bytes = (bits + 7) / 8;
  if (__builtin_mul_overflow(layout.row_bytes, rows, &layout.bytes) ||
      __builtin_mul_overflow(layout.bytes, static_cast<uint64_t>(page.chunk_depth), &layout.bytes) ||
      layout.bytes > INT64_MAX)
    return std::nullopt;
  return layout;
}

Status unpack_tiff_chunk(const TiffFile& file, const TiffPage& page, uint64_t chunk, std::span<std::byte> out,
                         uint64_t moved) {
  const auto broken = [&](const std::string& why) {
    return bad_input(file.name(), fmt::format("corrupt TIFF file: {} {} of page {} {}",
                                              page.tiled ? "tile" : "strip", chunk, page.number, why));
  };
  const auto all = file.bytes();
  if (chunk >= page.offsets.count) return broken("is missing");
  uint64_t at = 0;
  if (__builtin_add_overflow(file.number(page.offsets, chunk), moved, &at))
    return broken("leads past the end of the file");
  // Old files leave out how long strips are that are not compressed.
  const bool said = chunk < page.counts.count && moved == 0;
  const uint64_t length = said ? file.number(page.counts, chunk) : page.compression == 1 ? out.size() : 0;
  if (at > all.size() || length > all.size() - at) return broken("leads past the end of the file");
  std::span<const std::byte> in = all.subspan(at, length);
  std::vector<std::byte> turned;
  if (page.fill_order == 2) {
    turned.resize(in.size());
    std::transform(in.begin(), in.end(), turned.begin(), reversed);
    in = turned;
  }
  bool whole = false;
  switch (page.compression) {
    case 1:
      whole = in.size() >= out.size();
      if (whole) std::memcpy(out.data(), in.data(), out.size());
      break;
    case 5:
      if (in.size() >= 2 && in[0] == std::byte{0} && (in[1] & std::byte{1}) != std::byte{0})
        return bad_input(file.name(),
                         "LZW with its bits in the old order: expected that of TIFF 5 and later");
      whole = unpack_lzw(in, out);
      break;
    case 32773:
      whole = unpack_bits(in, out);
      break;
    case 50000:
      whole = unpack_zstd(in, out);
      break;
    default:
      whole = inflate_all(in, out);
      break;
  }
  if (!whole) return broken(fmt::format("does not hold {} bytes", out.size()));
  const bool swaps = file.big_endian() && page.predictor != 3;
  if (swaps && page.bits == 16) swap_all<uint16_t>(out);
  if (swaps && page.bits == 24) swap_all<std::array<uint8_t, 3>>(out);
  if (swaps && page.bits == 32) swap_all<uint32_t>(out);
  if (swaps && page.bits == 64) swap_all<uint64_t>(out);
  if (page.predictor == 1) return {};
  const auto layout = tiff_chunk_layout(page);
  if (!layout || layout->row_bytes == 0) return broken("has no rows");
  const auto stride = static_cast<size_t>(layout->samples);
  for (size_t row = 0; row + layout->row_bytes <= out.size(); row += layout->row_bytes) {
    const auto bytes = out.subspan(row, layout->row_bytes);
    if (page.predictor == 3)
      add_float_differences(bytes, stride, static_cast<size_t>(page.bits / 8));
    else if (page.bits == 8)
      add_differences<uint8_t>(bytes, stride);
    else if (page.bits == 16)
      add_differences<uint16_t>(bytes, stride);
    else if (page.bits == 32)
      add_differences<uint32_t>(bytes, stride);
    else
      add_differences<uint64_t>(bytes, stride);
  }
  return {};
}

}  // namespace voxkit
