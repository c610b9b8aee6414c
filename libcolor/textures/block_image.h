// Blocks of textures as an image of rows of them, as files have it: .dds and .astc.
#pragma once

#include <span>
#include <vector>

#include "formats/image/coded_image.h"
#include "libcolor/params.h"
#include "libcolor/textures/texture_layout.h"

namespace voxkit::color {

struct BlockImage {
  ColorCodec codec = ColorCodec::bc1;  ///< bc1, bc7 or astc
  BlockSize block_size;
  ImageSize size;                 ///< pixels
  std::vector<std::byte> blocks;  ///< row by row, as many as it takes to cover the pixels
};

/// Blocks that cover an image of this size: of a row, and rows.
ImageSize blocks_across(ImageSize size, BlockSize block);

/// The blocks of a part of a texture. Where it has none, they are its last one.
BlockImage block_image_of(std::span<const std::byte> part, const Params& params, uint32_t colors);
/// The part, of an image that covers that of so many colours. Errors: ErrorCode::input for blocks that are
/// not valid.
Result<std::vector<std::byte>> part_of(const BlockImage& image, ImageCurve curve, uint32_t colors);

/// A .dds file of bc1, with a header that all readers know, or of bc7, DXGI format 98; width and height are
/// the next multiples of 4, as some readers demand.
std::vector<std::byte> pack_dds(const BlockImage& image);
/// The first level of a .dds file of BC1 or BC7, of this size or of the next multiples of 4. Safe on any
/// bytes. Errors: ErrorCode::input, without a file's name.
Result<BlockImage> unpack_dds(std::span<const std::byte> file, ImageSize size);

/// An .astc file, as astcenc has them.
std::vector<std::byte> pack_astc(const BlockImage& image);
/// Of this size. Safe on any bytes. Errors: ErrorCode::input, without a file's name.
Result<BlockImage> unpack_astc(std::span<const std::byte> file, ImageSize size);

}  // namespace voxkit::color
