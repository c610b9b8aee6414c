// The images of the colour array as files of their own, one a part: for other programs to look at, and to
// encode anew.
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "libcolor/color.h"

namespace voxkit::color {

enum class TileFormat { png, jpeg, jp2, dds, astc };

/// By the ending of a name: .png .jpg .jpeg .jp2 .dds .astc.
std::optional<TileFormat> tile_format(std::string_view name);

/// Whether colours of this codec can be written so: .dds is for bc1 and bc7, .astc for astc, others for any.
/// Errors: ErrorCode::usage; ErrorCode::input, naming the package that is missing.
Status check_tile_format(TileFormat format, const Params& params);

/// The file of a part. Bytes of images, and blocks of textures, are as they are stored where the format is
/// theirs; else colours are encoded at the highest quality, which is lossless but for JPEG. Colours that are
/// no textures or images are laid along a Morton curve.
Result<std::vector<std::byte>> tile_of(const Volume& volume, uint64_t part, TileFormat format);

/// The colours of a tile, so many of them. Safe on any bytes. Errors: ErrorCode::input, without a file's
/// name.
Result<std::vector<Rgb>> colors_of_tile(std::span<const std::byte> file, TileFormat format, ImageCurve curve,
                                        uint32_t colors);

/// A tile as it is stored with these options; nothing where it must be encoded anew: it is of another codec,
/// or has other blocks. Errors as above.
Result<std::optional<std::vector<std::byte>>> part_of_tile(std::span<const std::byte> file, TileFormat format,
                                                           const Options& options, uint32_t colors);

/// Memory that one of these calls takes.
uint64_t tile_work_bytes(TileFormat format);

}  // namespace voxkit::color
