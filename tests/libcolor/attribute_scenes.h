// Voxels with attributes to test with, and what a plain reference makes of them.
#pragma once

#include <cmath>
#include <numbers>

#include "libcolor/attributes/attribute_params.h"
#include "libcolor/surface/octahedral.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {

inline AttributeSet all_attributes() {
  AttributeSet set;
  for (size_t i = 0; i < attribute_kinds.size(); ++i) set.add(static_cast<Attribute>(i));
  return set;
}
inline AttributeSet set_of(std::initializer_list<Attribute> attributes) {
  AttributeSet set;
  for (const Attribute a : attributes) set.add(a);
  return set;
}
inline AttributeSet only(Attribute attribute) {
  return set_of({attribute});
}

/// What values are like, one after the other.
enum class Pattern { constant, two, runs, ramps, random };
inline constexpr Pattern patterns[] = {Pattern::constant, Pattern::two, Pattern::runs, Pattern::ramps,
                                       Pattern::random};

/// So many values of an attribute, as they lie in memory.
inline std::vector<std::byte> values_of(Attribute attribute, size_t count, Pattern pattern, uint64_t seed) {
  std::mt19937_64 random(seed);
  const size_t bytes = kind_of(attribute).bytes;
  std::vector<std::byte> values(count * bytes);
  const auto word = [&] { return static_cast<uint32_t>(random()); };
  const std::array<uint32_t, 2> some = {word(), word()};
  uint32_t value = word();
  for (size_t i = 0, left = 0; i < count; ++i, --left) {
    if (left == 0) {
      left = 1 + random() % 200;
      if (pattern == Pattern::runs) value = word();
    }
    if (pattern == Pattern::two) value = some[random() % 2];
    if (pattern == Pattern::random) value = word();
    if (pattern == Pattern::ramps)
      for (uint32_t b = 0; b < 32; b += 8) {
        const uint32_t byte = (value >> b & 255) + (random() % 3 == 0 ? 1 : 0);
        value = (value & ~(255u << b)) | (byte & 255) << b;
      }
    put_value(value, bytes, &values[i * bytes]);
  }
  return values;
}

/// Attributes of each voxel, one after the other, as a VoxelRun has them.
inline std::vector<std::byte> interleaved(AttributeSet set, size_t count, Pattern pattern, uint64_t seed) {
  std::vector<std::byte> all(count * set.bytes());
  for (size_t i = 0; i < attribute_kinds.size(); ++i) {
    const auto attribute = static_cast<Attribute>(i);
    if (!set.has(attribute)) continue;
    const auto own = values_of(attribute, count, pattern, seed + i);
    const size_t bytes = kind_of(attribute).bytes;
    for (size_t v = 0; v < count; ++v)
      std::copy_n(&own[v * bytes], bytes, &all[v * set.bytes() + set.offset(attribute)]);
  }
  return all;
}

/// Voxels in memory, with attributes.
class AttributedSource final : public SurfaceSource {
 public:
  AttributedSource(Voxels voxels, Index3 dims, AttributeSet set, std::vector<std::byte> values,
                   size_t run = 999)
      : voxels_(std::move(voxels)), values_(std::move(values)), run_(run) {
    info_.dims = dims;
    info_.format = VoxelFormat::rgba32;
    info_.affine = Affine::plain({0.5, 0.5, 0.5}, info_.affine.origin);
    attributes_ = set;
  }
  Status read(Context&, const Sink& sink) override {
    const size_t bytes = attributes_.bytes();
    for (size_t i = 0; i < voxels_.size(); i += run_) {
      const size_t n = std::min(run_, voxels_.size() - i);
      VOX_CHECK(sink({std::span(voxels_).subspan(i, n), std::span(values_).subspan(i * bytes, n * bytes)}));
    }
    return {};
  }

 private:
  Voxels voxels_;
  std::vector<std::byte> values_;
  size_t run_;
};

/// Of a value of a voxel.
inline uint32_t value_in(std::span<const std::byte> all, AttributeSet set, size_t voxel,
                         Attribute attribute) {
  return value_at(&all[voxel * set.bytes() + set.offset(attribute)], kind_of(attribute).bytes);
}

/// Degrees between two octahedral normals, the plain way.
inline double degrees(uint32_t a, uint32_t b) {
  const auto vector = [](uint32_t v) {
    const auto of = [](uint32_t byte) { return std::max(-1.0, (static_cast<double>(byte) - 128) / 127); };
    double x = of(v & 255), y = of(v >> 8 & 255);
    const double z = 1 - std::fabs(x) - std::fabs(y);
    if (z < 0) {
      const double folded = (x < 0 ? -1 : 1) * (1 - std::fabs(y));
      y = (y < 0 ? -1 : 1) * (1 - std::fabs(x));
      x = folded;
    }
    const double length = std::sqrt(x * x + y * y + z * z);
    return std::array{x / length, y / length, z / length};
  };
  const auto p = vector(a), q = vector(b);
  double chord = 0;
  for (size_t i = 0; i < 3; ++i) chord += (p[i] - q[i]) * (p[i] - q[i]);
  return 2 * std::asin(std::min(1.0, std::sqrt(chord) / 2)) * 180 / std::numbers::pi;
}

/// How far one value is from another, the plain way: RGB, bytes, degrees, or 1e9 where ids differ.
inline double plain_error(Attribute attribute, uint32_t a, uint32_t b) {
  if (attribute == Attribute::id) return a == b ? 0 : 1e9;
  if (attribute == Attribute::normal) return degrees(a, b);
  double sum = 0;
  for (uint32_t i = 0; i < 24; i += 8) {
    const double d = static_cast<double>(a >> i & 255) - static_cast<double>(b >> i & 255);
    sum += d * d;
  }
  return std::sqrt(sum);
}

}  // namespace voxkit::color
