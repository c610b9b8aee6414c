// Directions in two bytes: an octahedron, unfolded into a square (Z. H. Cigolle et al., "A Survey of
// Efficient Representations for Independent Unit Vectors", JCGT 2014).
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "formats/hd.h"

namespace voxkit::color {

/// A byte stands for -1 to 1: (byte - 128) / 127, and 0 for -1 as well, so that the axes are exact.
struct Octahedral {
  uint8_t u = 128, v = 128;
  friend bool operator==(const Octahedral&, const Octahedral&) = default;
};

/// A vector in the direction; its coordinates are whole numbers whose absolute values add up to 127. The
/// direction (0, 0, 1) is (128, 128).
VOX_HD constexpr std::array<int, 3> octahedron_point(Octahedral o) {
  const auto of = [](uint8_t byte) { return byte == 0 ? -127 : int{byte} - 128; };
  const auto size = [](int x) { return x < 0 ? -x : x; };
  const int u = of(o.u), v = of(o.v), z = 127 - size(u) - size(v);
  if (z >= 0) return {u, v, z};
  // The lower half is folded out over the corners of the square.
  return {(u < 0 ? -1 : 1) * (127 - size(v)), (v < 0 ? -1 : 1) * (127 - size(u)), z};
}

/// The same, of length 1.
VOX_HD inline std::array<float, 3> direction_of(Octahedral o) {
  const std::array<int, 3> p = octahedron_point(o);
  const auto square = static_cast<float>(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
  const float scale = 1 / sqrtf(square);
  return {static_cast<float>(p[0]) * scale, static_cast<float>(p[1]) * scale,
          static_cast<float>(p[2]) * scale};
}

/// The bytes that stand for the direction of a vector, of any length; of (0, 0, 0) those of (0, 0, 1). It is
/// off by up to 1 degree. The bytes of any direction_of() give themselves, but where others stand for the
/// same direction.
VOX_HD inline Octahedral octahedral_of(double x, double y, double z) {
  const double sum = fabs(x) + fabs(y) + fabs(z);
  if (!(sum > 0)) return {};
  double u = x / sum, v = y / sum;
  if (z < 0) {
    const double folded = (x < 0 ? -1 : 1) * (1 - fabs(v));
    v = (y < 0 ? -1 : 1) * (1 - fabs(u));
    u = folded;
  }
  const auto byte = [](double t) { return static_cast<uint8_t>(static_cast<int>(t * 127 + 128.5)); };
  return {byte(u), byte(v)};
}

}  // namespace voxkit::color
