#include "libcolor/textures/block_image.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "libcolor/textures/part_image.h"
#include "libcolor/textures/texture.h"

namespace voxkit::color {
namespace {

/// Where in the image a block of a part is.
size_t place_of(Pixel corner, BlockSize block, uint32_t across) {
  return size_t{corner.y / block.height} * across + corner.x / block.width;
}

}  // namespace

ImageSize blocks_across(ImageSize size, BlockSize block) {
  return {(size.width + block.width - 1) / block.width, (size.height + block.height - 1) / block.height};
}

BlockImage block_image_of(std::span<const std::byte> part, const Params& params, uint32_t colors) {
  BlockImage image{params.codec, params.block_size, part_image_size(params.image_curve, colors), {}};
  const TextureLayout layout(params.image_curve, params.block_size, colors);
  const size_t bytes = texture_block_bytes(params.codec);
  const ImageSize across = blocks_across(image.size, image.block_size);
  const size_t count = size_t{across.width} * across.height;
  image.blocks.resize(count * bytes);
  for (size_t i = 0; i < count; ++i)
    std::memcpy(&image.blocks[i * bytes], &part[(layout.blocks() - 1) * bytes], bytes);
  for (uint32_t b = 0; b < layout.blocks(); ++b)
    std::memcpy(&image.blocks[place_of(layout.corner(b), image.block_size, across.width) * bytes],
                &part[b * bytes], bytes);
  return image;
}

Result<std::vector<std::byte>> part_of(const BlockImage& image, ImageCurve curve, uint32_t colors) {
  Params params;
  params.codec = image.codec;
  params.image_curve = curve;
  params.block_size = image.block_size;
  const TextureLayout layout(curve, image.block_size, colors);
  const size_t bytes = texture_block_bytes(image.codec);
  const uint32_t across = blocks_across(image.size, image.block_size).width;
  std::vector<std::byte> part(layout.blocks() * bytes);
  for (uint32_t b = 0; b < layout.blocks(); ++b)
    std::memcpy(&part[b * bytes], &image.blocks[place_of(layout.corner(b), image.block_size, across) * bytes],
                bytes);
  TextureReader reader;
  reader.open(part.data(), params, colors);
  if (const uint32_t invalid = reader.first_invalid(); invalid != reader.blocks()) {
    const Pixel at = layout.corner(invalid);
    return bad_input({}, fmt::format("the block at {}, {}: not a valid one", at.x, at.y));
  }
  return part;
}

}  // namespace voxkit::color
