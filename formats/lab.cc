#include "formats/lab.h"

#include <bit>
#include <cmath>
#include <cstdint>

namespace voxkit {
namespace {

/// A number above 0 with a third of the exponent, off the cube root by less than 6 %.
double near_cube_root(double v) {
  constexpr uint64_t two_thirds_of_bias = 0x2a9f7893'00000000;
  return std::bit_cast<double>(std::bit_cast<uint64_t>(v) / 3 + two_thirds_of_bias);
}

/// By Halley's method, which makes an error e about e^3: to the last bit or two.
double cube_root(double v) {
  if (!(v > 0) || std::isinf(v)) return v;
  double root = near_cube_root(v);
  for (int i = 0; i < 4; ++i) {
    const double cube = root * root * root;
    root *= (cube + 2 * v) / (2 * cube + v);
  }
  return root;
}

/// Of 0.001 to 1, by Newton's method.
double fifth_root(double v) {
  double root = 1;
  for (int i = 0; i < 16; ++i) {
    const double square = root * root;
    root -= (root - v / (square * square)) / 5;
  }
  return root;
}

}  // namespace

double srgb_to_linear(double stored) {
  if (stored <= 0.04045) return stored / 12.92;
  const double base = (stored + 0.055) / 1.055, square = base * base;
  return square * fifth_root(square);  // base to the power of 2.4
}

double lab_curve(double light) {
  constexpr double knee = 6.0 / 29;
  return light > knee * knee * knee ? cube_root(light) : light / (3 * knee * knee) + 4.0 / 29;
}

Lab lab_of_linear(double r, double g, double b) {
  // The white is the sum of each row, so that greys have a = b = 0 but for rounding.
  const auto part = [&](const double(&share)[3]) {
    return lab_curve(share[0] * r + share[1] * g + share[2] * b);
  };
  const double x = part(lab_shares[0]), y = part(lab_shares[1]), z = part(lab_shares[2]);
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

double delta_e(const Lab& p, const Lab& q) {
  const double l = p.l - q.l, a = p.a - q.a, b = p.b - q.b;
  return std::sqrt(l * l + a * a + b * b);
}

}  // namespace voxkit
