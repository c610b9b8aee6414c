// Parts of the colours as images in files: JPEG, JPEG 2000, PNG (section 4.1.2 of the paper; FORMAT.md,
// section 4.8).
#pragma once

#include <span>
#include <vector>

#include "formats/image/coded_image.h"
#include "libcolor/encoded_part.h"
#include "libcolor/params.h"
#include "libcolor/textures/image_curve.h"

namespace voxkit::color {

/// Of jpeg, jp2 and png.
ImageFormat image_format(ColorCodec codec);

/// How an encoder is asked for the image of so many colours.
ImageCoding image_coding_of(const Options& options, uint64_t colors);

/// Encodes 1 to 2^20 colours as a part, and decodes it for its error.
Result<EncodedPart> encode_as_image(std::span<const Rgb> colors, const Options& options);

/// The colours of a part, so many of them. Safe on any bytes. Errors: ErrorCode::input, without a file's
/// name.
Result<std::vector<Rgb>> decode_as_image(std::span<const std::byte> part, ColorCodec codec, ImageCurve curve,
                                         uint32_t colors);

/// Memory that one of these calls takes for a whole part.
uint64_t image_part_work_bytes(ColorCodec codec);

}  // namespace voxkit::color
