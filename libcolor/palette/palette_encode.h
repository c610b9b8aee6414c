// From colours to a part of palette encoded ones.
#pragma once

#include <span>

#include "libcolor/encoded_part.h"
#include "libcolor/palette/palette.h"

namespace voxkit::color {

/// Encodes 1 to 2^20 of the colours that a palette was chosen for as a part. `effort`, 1 to 9: blocks have up
/// to 2^(5 + effort) runs of one colour.
EncodedPart encode_palette_part(std::span<const Rgb> colors, const Palette& palette, int effort);

}  // namespace voxkit::color
