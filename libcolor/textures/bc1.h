// BC1, also known as DXT1 and S3TC: 16 colours in 8 bytes, each one of up to four on a line between two.
#pragma once

#include <array>
#include <cstddef>

#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// The colours of a block of 4 x 4 pixels, row by row.
using Pixels16 = std::array<Rgb, 16>;

inline constexpr uint32_t bc1_block_bytes = 8;

/// Encodes a block: the least sum of squared errors that is found. `effort`, 1 to 9: how long the ends of the
/// line are moved about. Writes 8 bytes.
void encode_bc1(const Pixels16& colors, int effort, std::byte* out);

/// Decodes a block; all bytes are valid. The fourth of three colours is black.
void decode_bc1(const std::byte* block, Pixels16& out);

}  // namespace voxkit::color
