// BC7, also known as BPTC: 16 colours in 16 bytes, on up to three lines between two colours each.
#pragma once

#include <cstddef>

#include "libcolor/textures/bc1.h"

namespace voxkit::color {

inline constexpr uint32_t bc7_block_bytes = 16;

/// Encodes a block, in that of the modes 0, 1, 2, 3 and 6 that comes nearest. `effort`, 1 to 9: how many ways
/// to part the pixels are tried. Writes 16 bytes.
void encode_bc7(const Pixels16& colors, int effort, std::byte* out);

/// Decodes a block of any mode, without alpha. Invalid ones are black.
void decode_bc7(const std::byte* block, Pixels16& out);
/// Whether a block has a mode.
inline bool valid_bc7(const std::byte* block) {
  return block[0] != std::byte{0};
}

}  // namespace voxkit::color
