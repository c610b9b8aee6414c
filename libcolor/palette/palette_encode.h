// From colours to a part of palette encoded ones.
#pragma once

#include <span>

#include "libcolor/encoded_part.h"
#include "libcolor/palette/palette.h"

namespace voxkit::color {

/// Encodes 1 to 2^20 of the colours that a palette was chosen for as a part. `effort`, 1 to 9: blocks have up
/// to 2^(5 + effort) runs of one colour.
EncodedPart encode_palette_part(std::span<const Rgb> colors, const Palette& palette, int effort);
/// The same of numbers of a palette's entries: the bytes and blocks of `part`.
void encode_palette_numbers(std::span<const uint16_t> numbers, uint32_t palette_colors, int effort,
                            EncodedPart& part);

}  // namespace voxkit::color
