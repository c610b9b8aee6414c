// From colours to a part of block encoded ones.
#pragma once

#include <cstddef>
#include <span>

#include "libcolor/blocks/block_layout.h"
#include "libcolor/encoded_part.h"

namespace voxkit::color {

/// What the encoder is asked for.
struct BlockOptions {
  double threshold = 9.56;  ///< greatest distance of a decoded colour, 0 or more
  int weight_bits = 0;      ///< 1 to 4: that many for all blocks (fws); 0: what suits each block (vws)
  int effort = 3;           ///< 1: the paper's greedy merging; 2 to 9: optimal parsing, with ever more tries
  ErrorSpace space = ErrorSpace::rgb;
};

/// From this effort on no macro block is larger than with effort 1.
inline constexpr int greedy_too = 4;

/// Endpoints with which any colour can be coded within a threshold: 5 and 6 bits are off by up to 6.1, in
/// CIELAB by up to 5.3.
Endpoints endpoints_for(double threshold, ErrorSpace space = ErrorSpace::rgb);

/// Encodes 1 to 2^20 colours as a part.
EncodedPart encode_part(std::span<const Rgb> colors, const BlockOptions& options);
/// The same with ends of that kind, which must do for the threshold. Of Endpoints::one and two, colours have
/// one or two channels; the others are 0.
EncodedPart encode_part(std::span<const Rgb> colors, Endpoints endpoints, const BlockOptions& options);

}  // namespace voxkit::color
