// CIELAB, and the light that sRGB values stand for. Plain arithmetic without a library's powers and roots:
// the same results on every machine.
#pragma once

namespace voxkit {

/// CIE 1976 L*a*b* relative to the white D65; white has L = 100.
struct Lab {
  double l = 0, a = 0, b = 0;
};

/// The sRGB transfer function (IEC 61966-2-1) from a stored value, 0..1, to linear light.
double srgb_to_linear(double stored);
/// Linear light with the primaries of sRGB, 0..1 a channel; what is above or below is dealt with likewise.
Lab lab_of_linear(double r, double g, double b);
/// The CIE 1976 difference: Euclidean distance in L*a*b*. About 2.3 is just noticeable.
double delta_e(const Lab& p, const Lab& q);

/// The curve from a share of the white's light, a cube root but for its beginning, to what L*, a* and b* are
/// made of.
double lab_curve(double light);
/// The share of the white's X, Y or Z that linear light 1 in R, G and B gives.
inline constexpr double lab_shares[3][3] = {{0.4124 / 0.9505, 0.3576 / 0.9505, 0.1805 / 0.9505},
                                            {0.2126, 0.7152, 0.0722},
                                            {0.0193 / 1.0890, 0.1192 / 1.0890, 0.9505 / 1.0890}};

}  // namespace voxkit
