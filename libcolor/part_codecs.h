// The table of color codecs: what each does with a part of the colours.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "libcolor/encoded_part.h"
#include "libcolor/palette/palette.h"
#include "libcolor/params.h"

namespace voxkit::color {

/// What there is beside the colours of a part.
struct PartContext {
  const Palette* palette = nullptr;  ///< of the scene, of the palette codec only
  std::span<const uint64_t> places;  ///< of the voxels that have the colours, of `predicted` only
};

struct PartCodec {
  ColorCodec codec;
  std::string_view name;
  /// Whether this build can encode with these options; an error says what is missing.
  Status (*support)(const Options& options);
  /// Encodes 1 to 2^20 colours.
  Result<EncodedPart> (*encode)(std::span<const Rgb> colors, const Options& options,
                                const PartContext& context);
  /// Bytes of a part of so many colours; null where parts say so themselves.
  uint64_t (*part_bytes)(const Params& params, uint32_t colors);
  /// What in a part of so many colours is not as FORMAT.md says, in words; empty if nothing is. Null where
  /// all bytes are colours, or where decoding a part tells.
  std::string (*check)(std::span<const std::byte> part, const Params& params, uint32_t colors);
};

/// What a codec, one of the enumeration, does.
const PartCodec& part_codec(ColorCodec codec);
/// By its name: "raw", "fws" …
std::optional<ColorCodec> codec_named(std::string_view name);
/// Greatest number of a codec in files.
int most_codec_number();

}  // namespace voxkit::color
