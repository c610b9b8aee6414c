// What libopenjp2 would trust in a JPEG 2000 file, checked beforehand (ISO/IEC 15444-1, annexes A and I).
#pragma once

#include <cstddef>
#include <span>

#include "formats/image/coded_image.h"

namespace voxkit {

/// The codestream in a .jp2 file, of which it is known then: it is one tile of this size, of three components
/// of 8 bits, sRGB, not subsampled; of up to 64 layers and 10 levels; with code-blocks of at least 16 x 16
/// and precincts of at least 32 x 32; coded alike in all components and tile-parts (no markers COC, POC, RGN,
/// PPM, PPT, CAP, and COD in the main header only). So its tables are in proportion to its pixels. Safe on
/// any bytes. Errors: ErrorCode::input, without a file's name.
Result<std::span<const std::byte>> jp2_codestream(std::span<const std::byte> file, ImageSize size);

}  // namespace voxkit
