#include "libsvmm/packed/halve.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

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
T commonest_of(const std::array<T, 8>& values, int count) {
  T best = values[0];
  for (int i = 0, most = 0; i < count; ++i) {
    const T value = values[static_cast<size_t>(i)];
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
      *out++ = rule == Rule::commonest ? commonest_of(values, count) : mean_of(values.data(), count);
    else
      *out++ = rule == Rule::commonest ? commonest_of(values, count) : mean_of(values.data(), count, fill);
  }
}

template <class T>
Status halve_slab(ConstVoxelSpan in, Index3 size, const VolumeInfo& info, std::byte* out, Context& ctx) {
  const Index3 half = (size + int64_t{1}) / int64_t{2};
  const Rule rule = info.is_labels || info.format == VoxelFormat::bitmap ? Rule::commonest : Rule::mean;
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
    const ConstVoxelSpan read{voxels.data, voxels.row_stride, voxels.slice_stride};
    if (visit) visit(read, slab.size());
    VOX_CHECK(info.format == VoxelFormat::float32
                  ? halve_slab<float>(read, slab.size(), info, out->data(), ctx)
              : info.format == VoxelFormat::density16
                  ? halve_slab<uint16_t>(read, slab.size(), info, out->data(), ctx)
                  : halve_slab<uint8_t>(read, slab.size(), info, out->data(), ctx));
    VOX_CHECK(
        spool.write({out->data(), static_cast<size_t>(half.x * half.y * ((slab.size().z + 1) / 2) * bytes)}));
  }
  return spool.finish();
}

}  // namespace voxkit::svmm
