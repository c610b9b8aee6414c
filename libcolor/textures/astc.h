// ASTC: blocks of up to 12 x 12 colours in 16 bytes each. Coded and decoded by libastcenc, where it was there
// when this was built.
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "formats/result.h"
#include "libcolor/surface/surface.h"
#include "libcolor/textures/texture_layout.h"

namespace voxkit::color {

inline constexpr uint32_t astc_block_bytes = 16;

/// All 14 sizes of blocks, from 8 bits a pixel to 0.89.
std::span<const BlockSize> astc_block_sizes();
/// That for a quality of 0 to 100: 100 is 4 x 4, 0 is 12 x 12, those between are as far apart.
BlockSize astc_block_size(int quality);

/// An error that names the package, where there is no libastcenc.
Status astc_support();

/// Encodes blocks, one after the other; of one thread. Only with astc_support().
class AstcEncoder {
 public:
  /// `effort`: 1 to 9, from libastcenc's fastest search to an exhaustive one.
  AstcEncoder(BlockSize size, int effort);
  ~AstcEncoder();
  /// `pixels`: of whole blocks, block after block, each row by row. Writes 16 bytes a block.
  void encode(std::span<const Rgb> pixels, std::byte* out);

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

/// Decodes a block of any bytes, row by row; invalid ones are magenta. Only with astc_support().
void decode_astc(BlockSize size, const std::byte* block, Rgb* out);
/// Whether a block is one that ASTC allows in images of 8 bits. Only with astc_support().
bool valid_astc(BlockSize size, const std::byte* block);

}  // namespace voxkit::color
