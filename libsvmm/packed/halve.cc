#include "libsvmm/packed/halve.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "formats/copy.h"
#include "formats/parallel.h"
#include "formats/spool.h"

namespace voxkit::svmm {
namespace {

enum class Rule { mean, commonest };

/// What up to 8 integers stand for; `fill`: not counted; -1: none.
template <class T>
T mean_of(const T* values, int count, int64_t fill) {
  int64_t sum = 0, counted = 0;
  for (int i = 0; i < count; ++i)
    if (values[i] != fill) sum += values[i], ++counted;
  return counted == 0 ? static_cast<T>(fill) : static_cast<T>((2 * sum + counted) / (2 * counted));
}
float mean_of(const float* values, int count) {
  double sum = 0;
  int counted = 0;
  for (int i = 0; i < count; ++i)
    if (!std::isnan(values[i])) sum += static_cast<double>(values[i]), ++counted;
  return counted == 0 ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(sum / counted);
}
template <class T>
T commonest_of(const std::array<T, 8>& values, int count, std::optional<T> fill) {
  T best = values[0];
  for (int i = 0, most = 0; i < count; ++i) {
    const T value = values[static_cast<size_t>(i)];
    if (fill && value == *fill) continue;
    const auto times = static_cast<int>(std::count(values.begin(), values.begin() + count, value));
    if (times > most || (times == most && value < best)) most = times, best = value;
  }
  return best;
}

/// One row of the coarser level, of up to 2 x 2 rows of `nx` voxels.
template <class T>
void halve_row(const T* const* rows, int row_count, int64_t nx, Rule rule, int64_t fill, T* out) {
  for (int64_t x = 0; x < nx; x += 2) {
    std::array<T, 8> values{};
    int count = 0;
    for (int r = 0; r < row_count; ++r)
      for (int64_t i = x; i < std::min(x + 2, nx); ++i) values[static_cast<size_t>(count++)] = rows[r][i];
    if constexpr (std::is_same_v<T, float>)
      *out++ = rule == Rule::commonest ? commonest_of<float>(values, count, std::nullopt)
                                       : mean_of(values.data(), count);
    else
      *out++ =
          rule == Rule::commonest
              ? commonest_of<T>(values, count, fill < 0 ? std::nullopt : std::optional(static_cast<T>(fill)))
              : mean_of(values.data(), count, fill);
  }
}

/// The mean of solid colours of `channels` bytes, weighted by alpha if they have one, and of alpha that of
/// all `count`. Not void, however dark or thin it is, unless all are.
void mean_of_colors(const std::byte* const* voxels, int count, size_t channels, std::byte* out) {
  std::array<uint32_t, 3> weighted{}, plain{};
  uint32_t weight = 0, alpha = 0, solid = 0;
  for (int i = 0; i < count; ++i) {
    std::array<uint32_t, 4> v{};
    for (size_t c = 0; c < channels; ++c) v[c] = std::to_integer<uint32_t>(voxels[i][c]);
    if ((v[0] | v[1] | v[2] | v[3]) == 0) continue;
    const uint32_t own = channels == 4 ? v[3] : 1;
    for (size_t c = 0; c < 3; ++c) weighted[c] += own * v[c], plain[c] += v[c];
    weight += own, alpha += v[3], ++solid;
  }
  std::fill(out, out + channels, std::byte{0});
  if (solid == 0) return;
  const auto& sums = weight != 0 ? weighted : plain;
  if (weight == 0) weight = solid;
  for (size_t c = 0; c < 3; ++c) out[c] = static_cast<std::byte>((2 * sums[c] + weight) / (2 * weight));
  const auto all = static_cast<uint32_t>(count);
  if (channels == 4) out[3] = static_cast<std::byte>((2 * alpha + all) / (2 * all));
  if (std::any_of(out, out + channels, [](std::byte byte) { return byte != std::byte{0}; })) return;
  out[alpha != 0 ? 3 : static_cast<size_t>(std::max_element(sums.begin(), sums.end()) - sums.begin())] =
      std::byte{1};
}

Status halve_colors(ConstVoxelSpan in, Index3 size, size_t channels, std::byte* out, Context& ctx) {
  const Index3 half = (size + int64_t{1}) / int64_t{2};
  return parallel_for(ctx, half.y * half.z, [&](int64_t i) -> Status {
    const int64_t y = i % half.y * 2, z = i / half.y * 2;
    for (int64_t x = 0; x < half.x; ++x) {
      const std::byte* voxels[8];
      int count = 0;
      for (int64_t k = z; k < std::min(z + 2, size.z); ++k)
        for (int64_t j = y; j < std::min(y + 2, size.y); ++j)
          for (int64_t a = 2 * x; a < std::min(2 * x + 2, size.x); ++a)
            voxels[count++] = in.row(j, k) + a * static_cast<int64_t>(channels);
      mean_of_colors(voxels, count, channels, out + (i * half.x + x) * static_cast<int64_t>(channels));
    }
    return {};
  });
}

template <class T>
Status halve_slab(ConstVoxelSpan in, Index3 size, const VolumeInfo& info, std::byte* out, Context& ctx) {
  const Index3 half = (size + int64_t{1}) / int64_t{2};
  const Rule rule = has_no_means(info) ? Rule::commonest : Rule::mean;
  const int64_t fill =
      info.fill && info.format != VoxelFormat::float32 ? static_cast<int64_t>(*info.fill) : -1;
  return parallel_for(ctx, half.y * half.z, [&](int64_t i) -> Status {
    const int64_t y = i % half.y * 2, z = i / half.y * 2;
    const T* rows[4];
    int count = 0;
    for (int64_t k = z; k < std::min(z + 2, size.z); ++k)
      for (int64_t j = y; j < std::min(y + 2, size.y); ++j)
        rows[count++] = reinterpret_cast<const T*>(in.row(j, k));
    halve_row(rows, count, size.x, rule, fill, reinterpret_cast<T*>(out) + i * half.x);
    return {};
  });
}

}  // namespace

Result<std::unique_ptr<VolumeSource>> halved(VolumeSource& source,
                                             const std::function<void(ConstVoxelSpan, Index3)>& visit,
                                             Context& ctx) {
  VolumeInfo info = source.info();
  const int bytes = voxel_bytes(info.format);
  const Slabs slabs(info.box(), bytes, slab_target(ctx));
  // Slabs may be one slice where slices are large: then pairs are put together.
  const int64_t slices = std::max<int64_t>(2, slabs.slab(0).size().z / 2 * 2);
  const Index3 dims = info.dims, half = (dims + int64_t{1}) / int64_t{2};
  VOX_TRY(const auto in,
          Buffer::allocate(static_cast<uint64_t>(dims.x * dims.y * slices * bytes), "a slab of voxels", ctx));
  VOX_TRY(const auto out, Buffer::allocate(static_cast<uint64_t>(half.x * half.y * (slices / 2) * bytes),
                                           "a slab of a coarser level", ctx));
  info.dims = half;
  info.affine = info.affine.coarser({2, 2, 2});
  VolumeSpool spool(info);
  for (int64_t z = 0; z < dims.z; z += slices) {
    VOX_CHECK(check_interrupt());
    const Box slab{{0, 0, z}, {dims.x, dims.y, std::min(z + slices, dims.z)}};
    const VoxelSpan voxels = packed(in->data(), slab.size(), info.format);
    VOX_CHECK(read_slab(source, slab, voxels, ctx));
    source.release(slab.lo.z, slab.hi.z);
    const ConstVoxelSpan read{voxels.data, voxels.row_stride, voxels.slice_stride};
    if (visit)
      VOX_CHECK(parallel_for(ctx, slab.size().z, [&](int64_t i) -> Status {
        visit({read.row(0, i), read.row_stride, read.slice_stride}, {slab.size().x, slab.size().y, 1});
        return {};
      }));
    VOX_CHECK(
        is_color(info.format) ? halve_colors(read, slab.size(), static_cast<size_t>(bytes), out->data(), ctx)
        : info.format == VoxelFormat::float32 ? halve_slab<float>(read, slab.size(), info, out->data(), ctx)
        : info.format == VoxelFormat::density16
            ? halve_slab<uint16_t>(read, slab.size(), info, out->data(), ctx)
            : halve_slab<uint8_t>(read, slab.size(), info, out->data(), ctx));
    VOX_CHECK(
        spool.write({out->data(), static_cast<size_t>(half.x * half.y * ((slab.size().z + 1) / 2) * bytes)}));
  }
  return spool.finish();
}

}  // namespace voxkit::svmm
