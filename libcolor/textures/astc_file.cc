// .astc files (Arm, "The .astc file format").
#include <fmt/format.h>

#include <algorithm>

#include "formats/little_endian.h"
#include "libcolor/textures/astc.h"
#include "libcolor/textures/block_image.h"

namespace voxkit::color {
namespace {

constexpr size_t file_header_bytes = 16;
constexpr uint32_t magic = 0x5ca1ab13;

}  // namespace

std::vector<std::byte> pack_astc(const BlockImage& image) {
  std::vector<std::byte> file(file_header_bytes + image.blocks.size());
  store_le(file.data(), magic);
  file[4] = static_cast<std::byte>(image.block_size.width);
  file[5] = static_cast<std::byte>(image.block_size.height);
  file[6] = std::byte{1};
  for (size_t i = 0; i < 3; ++i) {
    file[7 + i] = static_cast<std::byte>(image.size.width >> 8 * i);
    file[10 + i] = static_cast<std::byte>(image.size.height >> 8 * i);
  }
  file[13] = std::byte{1};
  std::copy(image.blocks.begin(), image.blocks.end(), file.begin() + file_header_bytes);
  return file;
}

Result<BlockImage> unpack_astc(std::span<const std::byte> file, ImageSize size) {
  const auto bad = [](const std::string& what) { return bad_input({}, "ASTC image: " + what); };
  if (file.size() < file_header_bytes || load_le<uint32_t>(file.data()) != magic)
    return bad("not an .astc file");
  const auto side = [&](size_t at) {
    return std::to_integer<uint32_t>(file[at]) | std::to_integer<uint32_t>(file[at + 1]) << 8 |
           std::to_integer<uint32_t>(file[at + 2]) << 16;
  };
  const BlockSize block{std::to_integer<uint32_t>(file[4]), std::to_integer<uint32_t>(file[5])};
  const auto sizes = astc_block_sizes();
  if (std::find(sizes.begin(), sizes.end(), block) == sizes.end() || file[6] != std::byte{1})
    return bad("not a size of blocks of 2D images");
  if (ImageSize{side(7), side(10)} != size || side(13) != 1)
    return bad(fmt::format("{} x {} x {} pixels: expected {} x {} x 1", side(7), side(10), side(13),
                           size.width, size.height));
  const ImageSize across = blocks_across(size, block);
  const size_t bytes = size_t{across.width} * across.height * astc_block_bytes;
  if (file.size() - file_header_bytes < bytes)
    return bad(fmt::format("{} bytes of blocks: expected {}", file.size() - file_header_bytes, bytes));
  const auto blocks = file.subspan(file_header_bytes, bytes);
  return BlockImage{ColorCodec::astc, block, size, {blocks.begin(), blocks.end()}};
}

}  // namespace voxkit::color
