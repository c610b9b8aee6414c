// Colour differences as people see them: CIELAB.
#pragma once

#include "formats/image.h"

namespace voxkit {

/// CIE 1976 L*a*b* relative to the white D65; white has L = 100.
struct Lab {
  double l = 0, a = 0, b = 0;
};

/// The sRGB transfer function (IEC 61966-2-1) from a stored value, 0..1, to linear light.
double srgb_to_linear(double stored);
/// Linear light with the primaries of sRGB, 0..1 a channel.
Lab lab_of_linear(double r, double g, double b);
/// The CIE 1976 difference: Euclidean distance in L*a*b*. About 2.3 is just noticeable.
double delta_e(const Lab& p, const Lab& q);

struct LabDiff {
  double mean_delta_e = 0, max_delta_e = 0;  ///< over the pixels
};

/// The differences of two images in CIELAB. Integers are sRGB over 0..255 or 0..65535, floats are linear
/// light, grey is R = G = B; alpha is ignored. A NaN makes both results NaN. Sums are taken in a fixed order:
/// the result is the same for any number of threads. Errors: those of check_comparable; ErrorCode::usage for
/// signed integers.
Result<LabDiff> diff_lab(const Image& a, const Image& b, Context& ctx);

}  // namespace voxkit
