// Units and noise of the terrain: whole numbers only, so that it is the same everywhere.
#pragma once

#include <cstdint>

namespace voxkit::color::terrain {

/// The side of the world, 128 metres, in units.
inline constexpr int side_bits = 24;
inline constexpr int32_t side = 1 << side_bits;
inline constexpr int32_t metre = 1 << 17;
/// Everything is below this height.
inline constexpr int32_t ceiling = 36 * metre;

constexpr int32_t cm(int64_t centimetres) {
  return static_cast<int32_t>(centimetres * metre / 100);
}

/// 32 bits that look random, of three numbers.
constexpr uint32_t hash(int32_t x, int32_t y, int32_t z) {
  uint32_t h = static_cast<uint32_t>(x) * 0x9e3779b1u ^ static_cast<uint32_t>(y) * 0x85ebca77u ^
               static_cast<uint32_t>(z) * 0xc2b2ae3du;
  h = (h ^ h >> 15) * 0x2c1b3c6du;
  h = (h ^ h >> 12) * 0x297a2d39u;
  return h ^ h >> 15;
}

/// 0..4096 to 0..4096, flat at both ends.
constexpr int32_t ease(int32_t t) {
  return static_cast<int32_t>(int64_t{t} * t * (3 * 4096 - 2 * t) >> 24);
}
/// 0 up to `lo`, 4096 from `hi` on, eased between them.
constexpr int32_t step(int64_t lo, int64_t hi, int64_t v) {
  if (v <= lo) return 0;
  if (v >= hi) return 4096;
  return ease(static_cast<int32_t>((v - lo) * 4096 / (hi - lo)));
}
/// From a to b by t of 0..4096.
constexpr int32_t blend(int32_t a, int32_t b, int32_t t) {
  return a + static_cast<int32_t>(int64_t{b - a} * t >> 12);
}

/// A random value at a corner of a square: -2048 to 2047.
constexpr int32_t value_noise(int32_t i, int32_t k, int32_t seed) {
  return static_cast<int32_t>(hash(i, k, seed) >> 20) - 2048;
}

/// Noise by random gradients at the corners of squares of 2^bits units, bits at least 12: about -2048 to
/// 2047.
inline int32_t gradient_noise(int32_t x, int32_t z, int bits, int32_t seed) {
  const int32_t i = x >> bits, k = z >> bits;
  const int32_t fx = (x & ((1 << bits) - 1)) >> (bits - 12), fz = (z & ((1 << bits) - 1)) >> (bits - 12);
  const auto corner = [&](int32_t dx, int32_t dz) {
    const uint32_t h = hash(i + dx, k + dz, seed);
    const int32_t gx = static_cast<int32_t>(h & 255) - 128, gz = static_cast<int32_t>(h >> 8 & 255) - 128;
    return (gx * (fx - dx * 4096) + gz * (fz - dz * 4096)) >> 7;
  };
  const int32_t tx = ease(fx), tz = ease(fz);
  return blend(blend(corner(0, 0), corner(1, 0), tx), blend(corner(0, 1), corner(1, 1), tx), tz);
}

}  // namespace voxkit::color::terrain
