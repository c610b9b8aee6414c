// What the encoder knows about a set of original voxels: how many, their sums, and their least and greatest
// value. Averages are formed once, from these exact sums, and rounded once (thesis section 2.1; FORMAT.md,
// section 2.4).
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "formats/volume.h"
#include "libsvmm/layout.h"

namespace voxkit::svmm {

/// The homogeneity test in units of stored values, and how averages are formed.
struct Criterion {
  Criterion(const Params& params, VoxelFormat f) {
    // The thesis expands a density d to (d, d, d, d), whose distances are twice as large.
    const double spread = params.layout == Layout::thesis && !is_color(f) ? 2 : 1;
    distance = params.delta * params.full_scale / spread;
    squared = static_cast<int64_t>(std::min(std::floor(distance * distance), 4.0 * 255 * 255));
    scalar = static_cast<int64_t>(std::min(std::floor(distance), 65535.0));
    layout = params.layout;
    alpha_weight = params.alpha_weight && f == VoxelFormat::rgba32;
    global = params.bound == Bound::global;
  }
  double distance;  ///< greatest distance allowed, in stored units
  int64_t squared;  ///< its square, rounded down (colours)
  int64_t scalar;   ///< itself, rounded down (integer scalars)
  Layout layout;
  bool alpha_weight, global;
  bool labels = false;  ///< scalars that are names: in place of an average they have their commonest
  /// Integer scalars: the stored value that stands for nothing measured; -1: none. It has no part in
  /// averages, and is near to itself only.
  int64_t fill = -1;
};

/// Rounded to nearest, halves up.
inline uint64_t rounded_quotient(uint64_t a, uint64_t b) {
  return (a + b / 2) / b;
}

template <VoxelFormat F>
struct Moments;

/// RGBA32 and RGB24.
template <VoxelFormat F>
requires(is_color(F)) struct Moments<F> {
  static constexpr int channels = attributes(F);
  uint64_t count = 0;
  uint64_t sum[3] = {};  ///< of the colours, each times its alpha if alpha_weight
  uint64_t alpha = 0;    ///< sum of alphas
  uint8_t lo[channels], hi[channels];

  Moments() {
    std::fill(lo, lo + channels, uint8_t{255});
    std::fill(hi, hi + channels, uint8_t{0});
  }
  /// `n` voxels, one after another.
  void add(const std::byte* v, int64_t n, const Criterion& criterion) {
    count += static_cast<uint64_t>(n);
    if (criterion.alpha_weight)
      add_components<true>(v, n);
    else
      add_components<false>(v, n);
  }
  void add(const Moments& m) {
    count += m.count;
    for (int k = 0; k < 3; ++k) sum[k] += m.sum[k];
    alpha += m.alpha;
    for (int k = 0; k < channels; ++k) lo[k] = std::min(lo[k], m.lo[k]), hi[k] = std::max(hi[k], m.hi[k]);
  }
  void add_uniform(const Voxel& v, uint64_t n, const Criterion& criterion) {
    Moments one;
    one.add(v.bytes.data(), 1, criterion);
    for (int k = 0; k < 3; ++k) one.sum[k] *= n;
    one.alpha *= n;
    one.count = n;
    add(one);
  }
  bool empty() const { return count == 0; }
  bool uniform() const { return std::equal(lo, lo + channels, hi); }
  /// The average as it will be decoded.
  Voxel value(const Criterion& criterion) const {
    Voxel v;
    if (uniform()) {
      std::memcpy(v.bytes.data(), lo, channels);
    } else {
      const uint64_t weight = criterion.alpha_weight ? alpha : count;
      for (int k = 0; k < 3; ++k)
        v.bytes[static_cast<size_t>(k)] =
            static_cast<std::byte>(weight ? rounded_quotient(sum[k], weight) : 0);
      if constexpr (channels == 4) v.bytes[3] = static_cast<std::byte>(rounded_quotient(alpha, count));
    }
    if constexpr (channels == 4)
      if (criterion.layout == Layout::thesis)
        v.bytes[3] =
            static_cast<std::byte>(alpha_from_3_bits(alpha_to_3_bits(std::to_integer<int>(v.bytes[3]))));
    return v;
  }
  /// Whether every voxel within [lo, hi] is near enough to `v`: sufficient for the voxels themselves.
  bool within(const Voxel& v, const Criterion& criterion) const {
    int64_t squared = 0;
    for (int k = 0; k < channels; ++k) {
      const int64_t a = std::to_integer<int>(v.bytes[static_cast<size_t>(k)]),
                    far = std::max(a - lo[k], hi[k] - a);
      squared += far * far;
    }
    return squared <= criterion.squared;
  }
  static bool near(const std::byte* voxel, const Voxel& v, const Criterion& criterion) {
    int squared = 0;
    for (int k = 0; k < channels; ++k) {
      const int d = std::to_integer<int>(voxel[k]) - std::to_integer<int>(v.bytes[static_cast<size_t>(k)]);
      squared += d * d;
    }
    return squared <= criterion.squared;
  }

 private:
  template <bool Weighted>
  void add_components(const std::byte* v, int64_t n) {
    for (int64_t end = 0; n > 0; n -= end, v += end * channels) {
      end = std::min<int64_t>(n, 1 << 15);  // as many as 32 bits can sum up
      uint32_t part[4] = {};
      for (int64_t i = 0; i < end; ++i) {
        uint8_t c[4] = {};
        std::memcpy(c, v + i * channels, channels);
        for (int k = 0; k < 3; ++k) part[k] += Weighted ? uint32_t{c[k]} * c[3] : c[k];
        part[3] += c[3];
        for (int k = 0; k < channels; ++k) lo[k] = std::min(lo[k], c[k]), hi[k] = std::max(hi[k], c[k]);
      }
      for (int k = 0; k < 3; ++k) sum[k] += part[k];
      alpha += part[3];
    }
  }
};

/// DENSITY8, DENSITY16 and BITMAP. A BITMAP average is its coverage, 0..255.
template <VoxelFormat F>
requires(F == VoxelFormat::density8 || F == VoxelFormat::density16 ||
         F == VoxelFormat::bitmap) struct Moments<F> {
  using Value = std::conditional_t<F == VoxelFormat::density16, uint16_t, uint8_t>;
  uint64_t count = 0, sum = 0;
  Value lo = static_cast<Value>(-1), hi = 0;
  uint64_t fills = 0;  ///< voxels of the fill value: in the volume, but counted here only

  static Value load(const std::byte* v) { return load_le<Value>(v); }
  static uint32_t key(Value x) { return x; }
  static Value from_key(uint32_t k) { return static_cast<Value>(k); }
  void add(const std::byte* v, int64_t n, const Criterion& criterion) {
    if (criterion.fill >= 0) {
      for (int64_t i = 0; i < n; ++i)
        add_uniform(Voxel::of(load(v + i * static_cast<int64_t>(sizeof(Value)))), 1, criterion);
      return;
    }
    count += static_cast<uint64_t>(n);
    for (int64_t end = 0; n > 0; n -= end, v += end * static_cast<int64_t>(sizeof(Value))) {
      end = std::min<int64_t>(n, 1 << 15);  // as many as 32 bits can sum up
      uint32_t part = 0;
      Value least = lo, greatest = hi;
      for (int64_t i = 0; i < end; ++i) {
        const Value x = load(v + i * static_cast<int64_t>(sizeof(Value)));
        part += x;
        least = std::min(least, x);
        greatest = std::max(greatest, x);
      }
      sum += part;
      lo = least;
      hi = greatest;
    }
  }
  void add(const Moments& m) {
    count += m.count;
    sum += m.sum;
    lo = std::min(lo, m.lo);
    hi = std::max(hi, m.hi);
    fills += m.fills;
  }
  void add_uniform(const Voxel& v, uint64_t n, const Criterion& criterion) {
    const Value x = load(v.bytes.data());
    if (x == criterion.fill)
      fills += n;
    else
      add(Moments{n, x * n, x, x, 0});
  }
  bool empty() const { return count == 0 && fills == 0; }
  bool uniform() const { return fills == 0 ? lo == hi : count == 0; }
  Voxel value(const Criterion& criterion) const {
    if (count == 0) return Voxel::of(static_cast<Value>(std::max<int64_t>(criterion.fill, 0)));
    return Voxel::of(static_cast<Value>(rounded_quotient(F == VoxelFormat::bitmap ? sum * 255 : sum, count)));
  }
  bool within(const Voxel& v, const Criterion& criterion) const {
    if (fills > 0) return count == 0;
    const int64_t a = decoded_value(v, F).template as<Value>();
    return a != criterion.fill && std::max(a - lo, hi - a) <= criterion.scalar;
  }
  static bool near(const std::byte* voxel, const Voxel& v, const Criterion& criterion) {
    const int64_t x = load(voxel), a = decoded_value(v, F).template as<Value>();
    if (criterion.fill >= 0 && (x == criterion.fill || a == criterion.fill)) return x == a;
    return std::abs(x - a) <= criterion.scalar;
  }
};

/// FLOAT32. Sums are over finite voxels, in double, in block order. lo and hi are keys that order all bit
/// patterns, so that "all equal" means equal bit for bit: -0, +0 and every NaN are told apart. A block with
/// NaN or infinity is homogeneous only if all its voxels are equal.
template <>
struct Moments<VoxelFormat::float32> {
  uint64_t count = 0, finite = 0;
  double sum = 0;
  uint32_t lo = ~uint32_t{0}, hi = 0;

  using Value = float;
  static Value load(const std::byte* v) { return load_le<float>(v); }
  static uint32_t key(float x) {
    const auto bits = std::bit_cast<uint32_t>(x);
    return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
  }
  static float from_key(uint32_t k) { return std::bit_cast<float>(k & 0x80000000u ? k & 0x7fffffffu : ~k); }
  void add(const std::byte* v, int64_t n, const Criterion&) {
    count += static_cast<uint64_t>(n);
    for (int64_t i = 0; i < n; ++i) {
      const float x = load_le<float>(v + i * 4);
      if (std::isfinite(x)) ++finite, sum += static_cast<double>(x);
      lo = std::min(lo, key(x));
      hi = std::max(hi, key(x));
    }
  }
  void add(const Moments& m) {
    count += m.count;
    finite += m.finite;
    sum += m.sum;
    lo = std::min(lo, m.lo);
    hi = std::max(hi, m.hi);
  }
  void add_uniform(const Voxel& v, uint64_t n, const Criterion&) {
    const float x = v.as<float>();
    const bool is_finite = std::isfinite(x);
    add(Moments{n, is_finite ? n : 0, is_finite ? static_cast<double>(x) * static_cast<double>(n) : 0, key(x),
                key(x)});
  }
  bool empty() const { return count == 0; }
  bool uniform() const { return lo == hi; }
  Voxel value(const Criterion&) const {
    if (uniform()) return Voxel::of(from_key(lo));
    return Voxel::of(finite ? static_cast<float>(sum / static_cast<double>(finite))
                            : std::numeric_limits<float>::quiet_NaN());
  }
  bool within(const Voxel& v, const Criterion& criterion) const {
    if (uniform()) return true;
    const double a = v.as<float>(), least = from_key(lo), greatest = from_key(hi);
    return criterion.distance > 0 && std::isfinite(least) && std::isfinite(greatest) &&
           std::max(a - least, greatest - a) <= criterion.distance;
  }
  static bool near(const std::byte* voxel, const Voxel& v, const Criterion& criterion) {
    const float x = load_le<float>(voxel), a = v.as<float>();
    if (std::bit_cast<uint32_t>(x) == std::bit_cast<uint32_t>(a)) return true;
    return criterion.distance > 0 && std::isfinite(x) && std::isfinite(a) &&
           std::abs(static_cast<double>(x) - static_cast<double>(a)) <= criterion.distance;
  }
};

}  // namespace voxkit::svmm
