// Colour differences as people see them: CIELAB.
#pragma once

#include "formats/image/image.h"
#include "formats/lab.h"

namespace voxkit {

struct LabDiff {
  double mean_delta_e = 0, max_delta_e = 0;  ///< over the pixels
};

/// The differences of two images in CIELAB. Integers are sRGB over 0..255 or 0..65535, floats are linear
/// light, grey is R = G = B; alpha is ignored. A NaN makes both results NaN. Sums are taken in a fixed order:
/// the result is the same for any number of threads. Errors: those of check_comparable; ErrorCode::usage for
/// signed integers.
Result<LabDiff> diff_lab(const Image& a, const Image& b, Context& ctx);

}  // namespace voxkit
