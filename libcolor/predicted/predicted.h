// Colours predicted from those of the voxels around, which differ from what is expected of them by no more
// than a threshold, or are coded until they do: for storage. A part is decoded as a whole.
// File: formats/FORMAT.md, section 4.12.
#pragma once

#include <span>

#include "libcolor/encoded_part.h"
#include "libcolor/params.h"
#include "libcolor/predicted/color_model.h"

namespace voxkit::color {

/// Colours of a section, whose decisions are coded together; chances go on from one to the next.
inline constexpr uint32_t section_colors = 1 << 16;

/// What decoding a part of so many colours takes beside these; what encoding one takes, and its decisions.
constexpr uint64_t predicted_decode_bytes(uint64_t colors) {
  return ColorModel::bytes + colors * (PartCells::bytes_a_cell + sizeof(Rgb) + 1);
}
inline constexpr uint64_t predicted_encode_bytes = predicted_decode_bytes(part_colors) + (uint64_t{16} << 20);

/// Encodes 1 to 2^20 colours of voxels at places in Morton order: none is further than options.threshold
/// from its original, and none below 1 differs from it.
EncodedPart encode_predicted(std::span<const Rgb> colors, std::span<const uint64_t> places, double threshold);

/// Decodes a part of `count` colours, of the voxels of `cells`. Safe on any bytes. Errors: ErrorCode::input,
/// saying what is wrong.
Result<std::vector<Rgb>> decode_predicted(std::span<const std::byte> part, std::span<const PartCell> cells,
                                          uint32_t count);

}  // namespace voxkit::color
