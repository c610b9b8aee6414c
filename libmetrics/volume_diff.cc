#include "libmetrics/volume_diff.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <mutex>
#include <type_traits>
#include <vector>

#include "formats/copy.h"
#include "formats/full_scale.h"
#include "formats/little_endian.h"
#include "formats/parallel.h"

namespace voxkit {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// What is summed up over a tile. Integers are summed in `whole`, floats in `real`; the other stays 0.
struct Sums {
  struct Whole {
    unsigned __int128 squares = 0, rgb_squares = 0, absolute = 0, signal = 0;
  } whole;
  struct Real {
    double squares = 0, absolute = 0, signal = 0;
  } real;
  double greatest = 0;                   ///< absolute error
  uint64_t farthest = 0;                 ///< squared distance of two colours
  double lo = infinity, hi = -infinity;  ///< finite sample values of A
  uint64_t differing = 0;                ///< voxels

  /// Adds the sums of a part, `times` over.
  void merge(const Sums& s, uint64_t times = 1) {
    whole.squares += s.whole.squares * times;
    whole.rgb_squares += s.whole.rgb_squares * times;
    whole.absolute += s.whole.absolute * times;
    whole.signal += s.whole.signal * times;
    // 0 * infinity is avoided by never merging a part no times.
    real.squares += s.real.squares * static_cast<double>(times);
    real.absolute += s.real.absolute * static_cast<double>(times);
    real.signal += s.real.signal * static_cast<double>(times);
    greatest = std::max(greatest, s.greatest);
    farthest = std::max(farthest, s.farthest);
    lo = std::min(lo, s.lo);
    hi = std::max(hi, s.hi);
    differing += s.differing * times;
  }
};

/// Where errors are counted, one of every voxel `times` over.
struct Counter {
  ErrorHistogram* histogram = nullptr;
  uint64_t times = 1;

  void operator()(double error) const { histogram->add(error, times); }
  explicit operator bool() const { return histogram != nullptr; }
};

/// Compares rows of voxels. `errors` may be null.
class Comparison {
 public:
  Comparison(const VolumeInfo& a, const VolumeInfo& b)
      : a_(a.format),
        b_(b.format),
        error_(error_volume_info(a, b).format),
        values_a_(a),
        values_b_(b),
        whole_(values_a_.is_small() && values_b_.is_small()),
        same_values_(a.bias() == b.bias() && a.sample_type == b.sample_type &&
                     (a.labels == b.labels || (a.labels && b.labels && *a.labels == *b.labels))) {}

  void row(const std::byte* a, const std::byte* b, int64_t n, std::byte* errors, Sums& sums,
           const Counter& count) const {
    if (is_color(a_)) return colors(a, b, n, errors, sums, count);
    switch (a_) {
      case VoxelFormat::density16:
        return first<uint16_t>(a, b, n, errors, sums, count);
      case VoxelFormat::float32:
        return first<float>(a, b, n, errors, sums, count);
      default:
        return first<uint8_t>(a, b, n, errors, sums, count);
    }
  }

 private:
  template <class A>
  void first(const std::byte* a, const std::byte* b, int64_t n, std::byte* errors, Sums& sums,
             const Counter& count) const {
    switch (b_) {
      case VoxelFormat::density16:
        return scalars<A, uint16_t>(a, b, n, errors, sums, count);
      case VoxelFormat::float32:
        return scalars<A, float>(a, b, n, errors, sums, count);
      default:
        return scalars<A, uint8_t>(a, b, n, errors, sums, count);
    }
  }

  template <class A, class B>
  void scalars(const std::byte* a, const std::byte* b, int64_t n, std::byte* errors, Sums& sums,
               const Counter& count) const {
    if constexpr (std::is_integral_v<A> && std::is_integral_v<B>)
      if (whole_) return integers<A, B>(a, b, n, errors, sums, count);
    reals<A, B>(a, b, n, errors, sums, count);
  }

  template <class A, class B>
  void integers(const std::byte* a, const std::byte* b, int64_t n, std::byte* errors, Sums& sums,
                const Counter& count) const {
    {
      // Rows are shorter than 2^31, so sums of squares of 17 bit differences fit 64 bits... as do those of
      // samples.
      uint64_t squares = 0, absolute = 0, signal = 0, differing = 0;
      uint32_t greatest = 0;
      int32_t lo = std::numeric_limits<int32_t>::max(), hi = std::numeric_limits<int32_t>::min();
      const auto bias_a = static_cast<int32_t>(values_a_.bias), bias_b = static_cast<int32_t>(values_b_.bias);
      for (int64_t i = 0; i < n; ++i) {
        const int32_t va = load_le<A>(a + i * static_cast<int64_t>(sizeof(A))) - bias_a;
        const int32_t vb = load_le<B>(b + i * static_cast<int64_t>(sizeof(B))) - bias_b;
        const uint32_t d = static_cast<uint32_t>(va < vb ? vb - va : va - vb);
        squares += uint64_t{d} * d;
        absolute += d;
        signal += static_cast<uint64_t>(int64_t{va} * va);
        differing += d != 0;
        greatest = std::max(greatest, d);
        lo = std::min(lo, va);
        hi = std::max(hi, va);
      }
      Sums part;
      part.whole = {squares, 0, absolute, signal};
      part.greatest = greatest;
      part.lo = lo;
      part.hi = hi;
      part.differing = differing;
      sums.merge(part);
      if (errors != nullptr || count) {
        for (int64_t i = 0; i < n; ++i) {
          const int32_t va = load_le<A>(a + i * static_cast<int64_t>(sizeof(A))) - bias_a;
          const int32_t vb = load_le<B>(b + i * static_cast<int64_t>(sizeof(B))) - bias_b;
          if (count) count(std::abs(va - vb));
          if (errors == nullptr) continue;
          if (error_ == VoxelFormat::float32)
            store_le(errors + 4 * i, static_cast<float>(std::abs(va - vb)));
          else
            store_le(errors + i * static_cast<int64_t>(sizeof(A)), static_cast<A>(std::abs(va - vb)));
        }
      }
    }
  }

  template <class A, class B>
  void reals(const std::byte* a, const std::byte* b, int64_t n, std::byte* errors, Sums& sums,
             const Counter& count) const {
    {
      Sums part;
      for (int64_t i = 0; i < n; ++i) {
        const A stored_a = load_le<A>(a + i * static_cast<int64_t>(sizeof(A)));
        const B stored_b = load_le<B>(b + i * static_cast<int64_t>(sizeof(B)));
        const double va = values_a_(stored_a), vb = values_b_(stored_b);
        double d;
        if constexpr (std::is_integral_v<A> && std::is_integral_v<B>) {
          const __int128 difference = values_a_.whole(stored_a) - values_b_.whole(stored_b);
          d = static_cast<double>(difference < 0 ? -difference : difference);
        } else {
          d = va == vb ? 0 : std::abs(va - vb);
        }
        if (std::isnan(d)) d = std::isnan(va) && std::isnan(vb) ? 0 : infinity;
        part.real.squares += d * d;
        part.real.absolute += d;
        if (std::isfinite(va)) {
          part.real.signal += va * va;
          part.lo = std::min(part.lo, va);
          part.hi = std::max(part.hi, va);
        }
        if (std::is_same_v<A, B> && same_values_)
          part.differing += std::memcmp(&stored_a, &stored_b, sizeof(A)) != 0;
        else
          part.differing += d != 0;
        part.greatest = std::max(part.greatest, d);
        if (count) count(d);
        if (errors == nullptr) continue;
        if (error_ == VoxelFormat::float32)
          store_le(errors + 4 * i, static_cast<float>(d));
        else
          store_le(errors + i * static_cast<int64_t>(sizeof(A)), static_cast<A>(std::min(d, 65535.0)));
      }
      sums.merge(part);
    }
  }

  void colors(const std::byte* a, const std::byte* b, int64_t n, std::byte* errors, Sums& sums,
              const Counter& count) const {
    const int bytes_a = voxel_bytes(a_), bytes_b = voxel_bytes(b_), bytes = std::max(bytes_a, bytes_b);
    uint64_t squares = 0, rgb_squares = 0, absolute = 0, signal = 0, differing = 0, farthest = 0;
    int greatest = 0;
    for (int64_t i = 0; i < n; ++i, a += bytes_a, b += bytes_b) {
      uint64_t voxel = 0, voxel_rgb = 0;
      for (int c = 0; c < bytes; ++c) {
        const int va = c < bytes_a ? std::to_integer<int>(a[c]) : 255;
        const int vb = c < bytes_b ? std::to_integer<int>(b[c]) : 255;
        const int d = std::abs(va - vb);
        voxel += static_cast<uint64_t>(d * d);
        if (c < 3) voxel_rgb = voxel;
        absolute += static_cast<uint64_t>(d);
        signal += static_cast<uint64_t>(va * va);
        greatest = std::max(greatest, d);
        if (count) count(d);
        if (errors != nullptr) *errors++ = static_cast<std::byte>(d);
      }
      squares += voxel;
      rgb_squares += voxel_rgb;
      differing += voxel != 0;
      farthest = std::max(farthest, voxel);
    }
    Sums part;
    part.whole = {squares, rgb_squares, absolute, signal};
    part.greatest = greatest;
    part.farthest = farthest;
    part.differing = differing;
    sums.merge(part);
  }

  /// From stored values to samples.
  struct Values {
    explicit Values(const VolumeInfo& info) {
      const auto value = [&](int64_t bits) -> __int128 {
        return info.sample_type == SampleType::u64 ? static_cast<__int128>(static_cast<uint64_t>(bits))
                                                   : bits;
      };
      bias = info.has_wide_base() ? -value(info.wide_base) : info.bias();
      if (!info.labels) return;
      for (const int64_t label : *info.labels) labels.push_back(value(label));
    }
    /// Whether all of them, and their differences, are 32 bit integers.
    bool is_small() const {
      constexpr __int128 most = int64_t{1} << 30;
      return labels.empty() && bias < most && bias > -most;
    }
    /// Of integers, exactly.
    __int128 whole(uint32_t stored) const {
      return labels.empty() ? stored - bias
                            : labels[std::min(static_cast<size_t>(stored), labels.size() - 1)];
    }
    template <class T>
    double operator()(T stored) const {
      if constexpr (std::is_integral_v<T>)
        return static_cast<double>(whole(stored));
      else
        return static_cast<double>(stored);
    }
    __int128 bias;
    std::vector<__int128> labels;
  };

  VoxelFormat a_, b_, error_;
  Values values_a_, values_b_;
  bool whole_, same_values_;
};

double decibels(double signal, double noise) {
  return noise == 0 ? infinity : 10 * std::log10(signal / noise);
}

VolumeDiff summarise(const Sums& sums, const VolumeInfo& a, int channels, std::optional<double> peak) {
  VolumeDiff diff;
  diff.dims = a.dims;
  diff.voxels = *checked_voxels(a.dims);
  diff.voxel_format = a.format;
  diff.type_name = type_name(a);
  const ValueRange samples = sums.lo <= sums.hi ? ValueRange{sums.lo, sums.hi} : ValueRange{0, 0};
  diff.peak = peak ? *peak : full_scale(a, {a.stored(samples.lo), a.stored(samples.hi)});
  const double voxels = static_cast<double>(diff.voxels), samples_count = voxels * channels;
  diff.mse = (static_cast<double>(sums.whole.squares) + sums.real.squares) / samples_count;
  diff.rmse = std::sqrt(diff.mse);
  diff.psnr_db = decibels(diff.peak * diff.peak, diff.mse);
  diff.snr_db =
      decibels((static_cast<double>(sums.whole.signal) + sums.real.signal) / samples_count, diff.mse);
  diff.max_abs_error = sums.greatest;
  diff.max_distance = is_color(a.format) ? std::sqrt(static_cast<double>(sums.farthest)) : sums.greatest;
  diff.mean_abs_error = (static_cast<double>(sums.whole.absolute) + sums.real.absolute) / samples_count;
  diff.differing_voxels = sums.differing;
  if (is_color(a.format)) {
    const double rgb = static_cast<double>(sums.whole.rgb_squares);
    diff.grmse = std::sqrt(rgb / (3 * voxels));
    diff.grmse_distance = std::sqrt(rgb / voxels);
  }
  return diff;
}

ErrorHistogram::Kind error_kind(VoxelFormat a, VoxelFormat b) {
  using Kind = ErrorHistogram::Kind;
  if (a == VoxelFormat::float32 || b == VoxelFormat::float32) return Kind::real;
  return a == VoxelFormat::density16 || b == VoxelFormat::density16 ? Kind::whole : Kind::bytes;
}

/// One side of the comparison: a slab at a time where the source is forward-only, else tile by tile.
struct Side {
  VolumeSource& source;
  std::unique_ptr<Buffer> slab_buffer = nullptr;
  VoxelSpan slab{};

  VoxelFormat format() const { return source.info().format; }

  /// The voxels of `box`, from the slab or read to `own`, which is allocated for `tile` on first use.
  Result<ConstVoxelSpan> voxels(const Box& slab_box, const Box& tile, const Box& box,
                                std::unique_ptr<std::byte[]>& own) {
    if (slab_buffer) {
      const Index3 at = box.lo - slab_box.lo;
      return ConstVoxelSpan{slab.row(at.y, at.z) + at.x * voxel_bytes(format()), slab.row_stride,
                            slab.slice_stride};
    }
    if (!own) own.reset(new std::byte[static_cast<size_t>(tile.voxels() * voxel_bytes(format()))]);
    const VoxelSpan span = packed(own.get(), box.size(), format());
    VOX_CHECK(source.read(box, span));
    return ConstVoxelSpan{span.data, span.row_stride, span.slice_stride};
  }
};

}  // namespace

VolumeInfo error_volume_info(const VolumeInfo& a, const VolumeInfo& b) {
  VolumeInfo info = a;
  info.range.reset();
  info.intercept = 0;
  info.labels.reset();
  info.wide_base = 0;
  info.is_labels = false;
  if (is_color(a.format)) {
    if (b.format == VoxelFormat::rgba32) info.format = b.format;
    return info;
  }
  const bool same = a.format == b.format && a.sample(0) == b.sample(0) && !a.labels && !b.labels;
  info.format = same ? a.format : VoxelFormat::float32;
  switch (info.format) {
    case VoxelFormat::density8:
      info.sample_type = SampleType::u8;
      break;
    case VoxelFormat::density16:
      info.sample_type = SampleType::u16;
      break;
    case VoxelFormat::bitmap:
      info.sample_type = SampleType::bit;
      break;
    default:
      info.sample_type = SampleType::f32;
  }
  return info;
}

Result<VolumeDiff> diff_volumes(VolumeSource& a, VolumeSource& b, std::optional<double> peak,
                                VolumeSink* errors, Context& ctx, ErrorHistogram* histogram) {
  const VolumeInfo& info = a.info();
  if (info.dims != b.info().dims) {
    const Index3 p = info.dims, q = b.info().dims;
    return bad_usage(fmt::format("the volumes have {},{},{} and {},{},{} voxels: expected the same extent",
                                 p.x, p.y, p.z, q.x, q.y, q.z));
  }
  if (is_color(info.format) != is_color(b.info().format))
    return bad_usage(fmt::format("{} cannot be compared with {}: convert one of them first", type_name(info),
                                 type_name(b.info())));

  const VolumeInfo error_info = error_volume_info(info, b.info());
  const int error_bytes = voxel_bytes(error_info.format);
  const Slabs slabs(info.box(), 4, slab_target(ctx));
  Side sides[2] = {{a}, {b}};
  for (Side& side : sides) {
    if (!side.source.forward_only()) continue;
    VOX_TRY(side.slab_buffer, Buffer::allocate(slabs.bytes(), "a slab of voxels", ctx));
  }
  std::unique_ptr<Buffer> error_buffer;
  if (errors != nullptr) {
    VOX_TRY(error_buffer, Buffer::allocate(slabs.bytes(), "a slab of errors", ctx));
  }
  const Comparison compare(info, b.info());
  const auto kind = error_kind(info.format, b.info().format);
  if (histogram != nullptr) *histogram = ErrorHistogram(kind);
  std::mutex histogram_mutex;

  Sums total;
  for (int64_t s = 0; s < slabs.count(); ++s) {
    const Box slab = slabs.slab(s);
    for (Side& side : sides) {
      if (!side.slab_buffer) continue;
      side.slab = packed(side.slab_buffer->data(), slab.size(), side.format());
      VOX_CHECK(side.source.read(slab, side.slab));
    }
    VoxelSpan error_slab;
    if (error_buffer) error_slab = packed(error_buffer->data(), slab.size(), error_info.format);
    const auto errors_at = [&](const Box& box) {
      const Index3 at = box.lo - slab.lo;
      return VoxelSpan{error_slab.row(at.y, at.z) + at.x * error_bytes, error_slab.row_stride,
                       error_slab.slice_stride};
    };
    const auto known = [&](const Box& box, Sums& sums, ErrorHistogram* counts) {
      const auto value_a = a.uniform(box);
      const auto value_b = value_a ? b.uniform(box) : std::nullopt;
      if (!value_b) return false;
      Sums one;
      Voxel error;
      const auto times = static_cast<uint64_t>(box.voxels());
      compare.row(value_a->bytes.data(), value_b->bytes.data(), 1, error.bytes.data(), one, {counts, times});
      sums.merge(one, times);
      if (error_buffer) fill(errors_at(box), box.size(), error_info.format, error);
      return true;
    };

    if (!known(slab, total, histogram)) {
      for (const Side& side : sides) side.source.expect(slab.lo.z, slab.hi.z);
      // Some tiles at a time, whose sums are then added in order: of a hostile file there may be any number.
      constexpr int64_t batch = 4096;
      std::vector<Sums> parts;
      const auto compare_tile = [&](int64_t t, Sums& sums) -> Status {
        const Box tile = Slabs::tile(slab, t);
        std::unique_ptr<std::byte[]> own[2];
        std::optional<ErrorHistogram> counts;
        if (histogram != nullptr) counts.emplace(kind);
        VOX_CHECK(walk_tile(
            tile, [&](const Box& box) { return known(box, sums, counts ? &*counts : nullptr); },
            [&](const Box& box) -> Status {
              VOX_TRY(const auto voxels_a, sides[0].voxels(slab, tile, box, own[0]));
              VOX_TRY(const auto voxels_b, sides[1].voxels(slab, tile, box, own[1]));
              for (int64_t z = 0; z < box.size().z; ++z)
                for (int64_t y = 0; y < box.size().y; ++y)
                  compare.row(voxels_a.row(y, z), voxels_b.row(y, z), box.size().x,
                              error_buffer ? errors_at(box).row(y, z) : nullptr, sums,
                              {counts ? &*counts : nullptr});
              return {};
            }));
        if (counts) {
          std::lock_guard lock(histogram_mutex);
          histogram->add(*counts);
        }
        return {};
      };
      const int64_t tiles = Slabs::tiles(slab);
      for (int64_t first = 0; first < tiles; first += batch) {
        parts.assign(static_cast<size_t>(std::min(batch, tiles - first)), {});
        VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(parts.size()), [&](int64_t i) {
          return compare_tile(first + i, parts[static_cast<size_t>(i)]);
        }));
        for (const Sums& part : parts) total.merge(part);
      }
      for (const Side& side : sides) side.source.release(slab.lo.z, slab.hi.z);
    }
    if (errors != nullptr)
      VOX_CHECK(errors->write(slab.lo.z, slab.hi.z,
                              {error_slab.data, error_slab.row_stride, error_slab.slice_stride}));
    ctx.progress(static_cast<double>(slab.hi.z) / static_cast<double>(info.dims.z));
  }
  if (errors != nullptr) VOX_CHECK(errors->finish());
  const int channels = std::max(attributes(info.format), attributes(b.info().format));
  return summarise(total, info, channels, peak);
}

}  // namespace voxkit
