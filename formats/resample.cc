#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "formats/convert.h"

namespace voxkit {
namespace {

/// The source voxels that one voxel is made of along an axis, with whole weights.
struct Taps {
  int64_t first = 0;
  std::vector<int64_t> weights;
};

/// Along one axis: from n voxels to m. The weights of any voxel add up to `total`.
struct Axis {
  int64_t n = 1, m = 1;
  int64_t total() const { return m < n ? n : m > n ? 2 * m : 1; }

  Taps taps(int64_t i) const {
    if (m == n) return {i, {1}};
    if (m < n) {
      // In units of 1/m of a source voxel, voxel i covers [i n, (i + 1) n).
      const int64_t lo = i * n, hi = lo + n;
      Taps taps{lo / m, {}};
      for (int64_t v = taps.first; v * m < hi; ++v)
        taps.weights.push_back(std::min(hi, (v + 1) * m) - std::max(lo, v * m));
      return taps;
    }
    // In units of 1/2m, the centre of voxel i lies at (2i + 1) n - m from that of source voxel 0.
    const int64_t at = std::clamp<int64_t>((2 * i + 1) * n - m, 0, (n - 1) * 2 * m);
    const int64_t first = at / (2 * m), part = at % (2 * m);
    if (part == 0) return {first, {2 * m}};
    return {first, {2 * m - part, part}};
  }

  /// Source voxels under the voxels lo..hi - 1.
  std::pair<int64_t, int64_t> under(int64_t lo, int64_t hi) const {
    const Taps last = taps(hi - 1);
    return {taps(lo).first, last.first + static_cast<int64_t>(last.weights.size())};
  }
};

/// Boxes that need more source voxels than this are made in parts.
constexpr int64_t part_voxels = int64_t{1} << 20;
constexpr int64_t largest_reduction = int64_t{1} << 24;

class ResampledSource : public VolumeSource {
 public:
  ResampledSource(std::unique_ptr<VolumeSource> source, Index3 dims) : source_(std::move(source)) {
    info_ = source_->info();
    Affine::Vector factors;
    for (int a = 0; a < 3; ++a) {
      axes_[a] = {info_.dims[a], dims[a]};
      factors[static_cast<size_t>(a)] = static_cast<double>(axes_[a].n) / static_cast<double>(axes_[a].m);
    }
    info_.affine = info_.affine.coarser(factors);  // the outer faces stay where they are
    info_.dims = dims;
    info_.range.reset();
  }

  std::optional<Voxel> uniform(const Box& box) const override {
    auto value = source_->uniform(under(box));
    // Colour without coverage is lost in the average.
    if (value && info_.format == VoxelFormat::rgba32 && value->bytes[3] == std::byte{0}) return Voxel{};
    return value;
  }

  Status read(const Box& box, VoxelSpan out) override {
    const Index3 size = box.size();
    if (under(box).voxels() > part_voxels && box.voxels() > 1) {
      const int axis = size.z > 1 ? 2 : size.y > 1 ? 1 : 0;
      Box low = box, high = box;
      low.hi[axis] = high.lo[axis] = box.lo[axis] + size[axis] / 2;
      const Index3 at = high.lo - box.lo;
      VOX_CHECK(read(low, out));
      return read(high,
                  {out.row(at.y, at.z) + at.x * voxel_bytes(info_.format), out.row_stride, out.slice_stride});
    }
    switch (info_.format) {
      case VoxelFormat::rgba32:
        return make<uint8_t, 4, uint64_t>(box, out);
      case VoxelFormat::rgb24:
        return make<uint8_t, 3, uint64_t>(box, out);
      case VoxelFormat::density16:
        return make<uint16_t, 1, uint64_t>(box, out);
      case VoxelFormat::float32:
        return make<float, 1, double>(box, out);
      default:
        return make<uint8_t, 1, uint64_t>(box, out);
    }
  }

 private:
  Box under(const Box& box) const {
    Box b;
    for (int a = 0; a < 3; ++a) std::tie(b.lo[a], b.hi[a]) = axes_[a].under(box.lo[a], box.hi[a]);
    return b;
  }

  template <class T, int channels, class Sum>
  Status make(const Box& box, VoxelSpan out) {
    // Sums over y and z fit 64 bits (checked by `resample`); those over x as well need more.
    using Total = std::conditional_t<std::is_same_v<Sum, double>, double, unsigned __int128>;
    constexpr bool weighted = channels == 4;  // by alpha
    const Box from = under(box);
    const Index3 from_size = from.size(), size = box.size();
    std::unique_ptr<std::byte[]> voxels(
        new std::byte[static_cast<size_t>(from.voxels()) * sizeof(T) * channels]);
    const VoxelSpan in = packed(voxels.get(), from_size, info_.format);
    VOX_CHECK(source_->read(from, in));

    std::vector<Taps> across;
    for (int64_t x = box.lo.x; x < box.hi.x; ++x) across.push_back(axes_[0].taps(x));
    std::vector<Sum> sums(static_cast<size_t>(from_size.x * channels));
    const Total denominator = static_cast<Total>(axes_[0].total()) * static_cast<Total>(axes_[1].total()) *
                              static_cast<Total>(axes_[2].total());
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y) {
        const Taps up = axes_[1].taps(box.lo.y + y), deep = axes_[2].taps(box.lo.z + z);
        std::fill(sums.begin(), sums.end(), Sum{0});
        for (size_t k = 0; k < deep.weights.size(); ++k)
          for (size_t j = 0; j < up.weights.size(); ++j)
            add_row<T, channels, Sum>(in.row(up.first - from.lo.y + static_cast<int64_t>(j),
                                             deep.first - from.lo.z + static_cast<int64_t>(k)),
                                      static_cast<Sum>(up.weights[j]) * static_cast<Sum>(deep.weights[k]),
                                      sums);
        std::byte* row = out.row(y, z);
        for (int64_t x = 0; x < size.x; ++x, row += sizeof(T) * channels) {
          const Taps& taps = across[static_cast<size_t>(x)];
          Total total[channels] = {};
          for (size_t i = 0; i < taps.weights.size(); ++i)
            for (size_t c = 0; c < channels; ++c)
              total[c] +=
                  static_cast<Total>(taps.weights[i]) *
                  static_cast<Total>(sums[(static_cast<size_t>(taps.first - from.lo.x) + i) * channels + c]);
          T value[channels];
          for (size_t c = 0; c < channels; ++c) {
            const Total d = weighted && c < 3 ? total[channels - 1] : denominator;
            if constexpr (std::is_same_v<Sum, double>)
              value[c] = static_cast<T>(total[c] / d);
            else
              value[c] = d == 0 ? T{0} : static_cast<T>((total[c] + d / 2) / d);
          }
          std::memcpy(row, value, sizeof value);
        }
      }
    return {};
  }

  template <class T, size_t channels, class Sum>
  static void add_row(const std::byte* row, Sum weight, std::vector<Sum>& sums) {
    for (size_t i = 0; i < sums.size(); i += channels) {
      T value[channels];
      std::memcpy(value, row + i * sizeof(T), sizeof value);
      const Sum w = channels == 4 ? weight * static_cast<Sum>(value[channels - 1]) : weight;
      for (size_t c = 0; c < channels; ++c) sums[i + c] += (c < 3 ? w : weight) * static_cast<Sum>(value[c]);
    }
  }

  std::unique_ptr<VolumeSource> source_;
  Axis axes_[3];
};

/// Labels have no averages: each voxel is the source's voxel that its centre lies in.
class NearestSource final : public VolumeSource {
 public:
  NearestSource(std::unique_ptr<VolumeSource> source, Index3 dims)
      : source_(std::move(source)), old_(source_->info().dims) {
    info_ = source_->info();
    Affine::Vector factors;
    for (int a = 0; a < 3; ++a)
      factors[static_cast<size_t>(a)] = static_cast<double>(old_[a]) / static_cast<double>(dims[a]);
    info_.affine = info_.affine.coarser(factors);
    info_.dims = dims;
  }
  Status read(const Box& box, VoxelSpan out) override {
    const Index3 size = box.size(), first = nearest(box.lo), last = nearest(box.hi - Index3(1));
    const int64_t bytes = voxel_bytes(info_.format);
    const Index3 row{last.x - first.x + 1, 1, 1};
    std::vector<std::byte> voxels(static_cast<size_t>(row.x * bytes));
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y) {
        const Index3 at = nearest(box.lo + Index3(0, y, z));
        VOX_CHECK(source_->read({{first.x, at.y, at.z}, {last.x + 1, at.y + 1, at.z + 1}},
                                packed(voxels.data(), row, info_.format)));
        for (int64_t x = 0; x < size.x; ++x)
          std::memcpy(out.row(y, z) + x * bytes,
                      &voxels[static_cast<size_t>((nearest(box.lo + Index3(x, 0, 0)).x - first.x) * bytes)],
                      static_cast<size_t>(bytes));
      }
    return {};
  }

 private:
  Index3 nearest(Index3 voxel) const {
    Index3 at;
    for (int a = 0; a < 3; ++a) at[a] = (2 * voxel[a] + 1) * old_[a] / (2 * info_.dims[a]);
    return at;
  }
  std::unique_ptr<VolumeSource> source_;
  Index3 old_;
};

}  // namespace

Result<std::unique_ptr<VolumeSource>> resample(std::unique_ptr<VolumeSource> source, Index3 dims) {
  const Index3 old = source->info().dims;
  if (dims == old) return source;
  for (int a = 0; a < 3; ++a)
    if (dims[a] < 1 || dims[a] > (1 << 20) || old[a] > (1 << 20))
      return bad_usage(fmt::format("cannot resample {},{},{} to {},{},{}: expected sides of 1 to {}", old.x,
                                   old.y, old.z, dims.x, dims.y, dims.z, 1 << 20));
  if (!checked_voxels(dims))
    return bad_usage("the resampled volume is too large: expected at most 2^62 voxels");
  if (source->forward_only())
    return bad_usage(
        "cannot resample packed or piped data, which is read front to back: unpack it to a file first");
  const int64_t per_voxel = (old.x / dims.x + 2) * (old.y / dims.y + 2) * (old.z / dims.z + 2);
  if (per_voxel > largest_reduction)
    return bad_usage(
        fmt::format("one voxel would cover {} voxels: expected at most {}: resample in two steps", per_voxel,
                    largest_reduction));
  if (source->info().is_labels) return std::make_unique<NearestSource>(std::move(source), dims);
  if (source->info().fill && source->info().format != VoxelFormat::float32)
    return bad_usage(
        "averages of integers do not leave out a fill value: convert them with --output-type f32 first");
  return std::make_unique<ResampledSource>(std::move(source), dims);
}

}  // namespace voxkit
