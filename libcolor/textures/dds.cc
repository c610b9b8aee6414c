// .dds files (Microsoft, "Programming guide for DDS").
#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "formats/little_endian.h"
#include "libcolor/textures/block_image.h"
#include "libcolor/textures/texture.h"

namespace voxkit::color {
namespace {

constexpr size_t file_header_bytes = 128, long_header_bytes = 148;
constexpr uint32_t magic = 0x20534444;                                            // "DDS "
constexpr uint32_t dxt1 = 0x31545844, dx10 = 0x30315844;                          // "DXT1", "DX10"
constexpr uint32_t bc1_unorm = 71, bc1_srgb = 72, bc7_unorm = 98, bc7_srgb = 99;  // DXGI formats

std::optional<ColorCodec> codec_of(uint32_t dxgi) {
  if (dxgi == bc1_unorm || dxgi == bc1_srgb) return ColorCodec::bc1;
  if (dxgi == bc7_unorm || dxgi == bc7_srgb) return ColorCodec::bc7;
  return std::nullopt;
}

uint32_t whole_blocks(uint32_t pixels) {
  return (pixels + 3) / 4 * 4;
}

}  // namespace

std::vector<std::byte> pack_dds(const BlockImage& image) {
  const bool bc7 = image.codec == ColorCodec::bc7;
  const size_t header = bc7 ? long_header_bytes : file_header_bytes;
  std::vector<std::byte> file(header + image.blocks.size());
  const auto put = [&](size_t at, uint32_t value) { store_le(&file[at], value); };
  put(0, magic);
  put(4, 124);      // bytes of the header
  put(8, 0x81007);  // caps, height, width, pixel format, linear size
  put(12, whole_blocks(image.size.height));
  put(16, whole_blocks(image.size.width));
  put(20, static_cast<uint32_t>(image.blocks.size()));
  put(28, 1);   // levels
  put(76, 32);  // bytes of the pixel format
  put(80, 4);   // it is named
  put(84, bc7 ? dx10 : dxt1);
  put(108, 0x1000);  // a texture
  if (bc7) {
    put(128, bc7_unorm);  // of sRGB colours, too: not all readers know the other number
    put(132, 3);          // 2D
    put(140, 1);          // one of them
  }
  std::copy(image.blocks.begin(), image.blocks.end(), file.begin() + static_cast<ptrdiff_t>(header));
  return file;
}

Result<BlockImage> unpack_dds(std::span<const std::byte> file, ImageSize size) {
  const auto bad = [](const std::string& what) { return bad_input({}, "DDS image: " + what); };
  const auto field = [&](size_t at) { return load_le<uint32_t>(&file[at]); };
  if (file.size() < file_header_bytes || field(0) != magic || field(4) != 124 || field(76) != 32)
    return bad("not a .dds file");
  std::optional<ColorCodec> codec;
  size_t header = file_header_bytes;
  if ((field(80) & 4) != 0 && field(84) == dxt1) codec = ColorCodec::bc1;
  if ((field(80) & 4) != 0 && field(84) == dx10 && file.size() >= long_header_bytes) {
    header = long_header_bytes;
    codec = codec_of(field(128));
    if (field(132) != 3 || field(140) != 1) return bad("not one 2D texture");
  }
  if (!codec) return bad("of another format: expected BC1 or BC7");
  const ImageSize found{field(16), field(12)};
  if ((found.width != size.width && found.width != whole_blocks(size.width)) ||
      (found.height != size.height && found.height != whole_blocks(size.height)))
    return bad(
        fmt::format("{} x {} pixels: expected {} x {}", found.width, found.height, size.width, size.height));
  const ImageSize across = blocks_across(size, {});
  const size_t bytes = size_t{across.width} * across.height * texture_block_bytes(*codec);
  if (file.size() - header < bytes)
    return bad(fmt::format("{} bytes of blocks: expected {}", file.size() - header, bytes));
  const auto blocks = file.subspan(header, bytes);
  return BlockImage{*codec, {}, size, {blocks.begin(), blocks.end()}};
}

}  // namespace voxkit::color
