#include "formats/volume/strided_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <vector>

namespace voxkit {
namespace {

constexpr int64_t batch_voxels = 4096;

template <size_t bytes>
void gather(const std::byte* from, int64_t step, int64_t count, int64_t out_step, std::byte* out) {
  for (int64_t i = 0; i < count; ++i, from += step, out += out_step) std::memcpy(out, from, bytes);
}

/// Samples of `count` voxels in a row, components beside each other.
void gather_row(const std::byte* from, const Strides& strides, const SampleLayout& layout, int64_t count,
                std::byte* out) {
  const int64_t bytes = sample_bytes(layout.type), voxel = layout.bytes_per_voxel();
  for (int c = 0; c < layout.components; ++c, from += strides.component, out += bytes) switch (bytes) {
      case 1:
        gather<1>(from, strides.x, count, voxel, out);
        break;
      case 2:
        gather<2>(from, strides.x, count, voxel, out);
        break;
      case 4:
        gather<4>(from, strides.x, count, voxel, out);
        break;
      default:
        gather<8>(from, strides.x, count, voxel, out);
    }
}

class StridedSource final : public VolumeSource {
 public:
  StridedSource(std::shared_ptr<const MappedFile> file, uint64_t offset, const Strides& strides,
                const VolumeInfo& info, const SampleLayout& layout)
      : file_(std::move(file)), first_(file_->bytes().data() + offset), strides_(strides), layout_(layout) {
    info_ = info;
  }
  Status read(const Box& box, VoxelSpan out) override {
    const Index3 size = box.size();
    std::vector<std::byte> row(
        static_cast<size_t>(std::min(size.x, batch_voxels) * layout_.bytes_per_voxel()));
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y)
        for (int64_t x = 0; x < size.x; x += batch_voxels) {
          const int64_t n = std::min(batch_voxels, size.x - x);
          const std::byte* const from = first_ + (box.lo.x + x) * strides_.x + (box.lo.y + y) * strides_.y +
                                        (box.lo.z + z) * strides_.z;
          gather_row(from, strides_, layout_, n, row.data());
          convert_samples(row.data(), layout_, n, info_, out.row(y, z) + x * voxel_bytes(info_.format));
        }
    return {};
  }

 private:
  std::shared_ptr<const MappedFile> file_;
  const std::byte* first_;
  Strides strides_;
  SampleLayout layout_;
};

/// Bytes from the first sample to behind the last one; nothing where 63 bits do not hold it.
std::optional<uint64_t> extent(const Strides& strides, Index3 dims, const SampleLayout& layout) {
  int64_t end = sample_bytes(layout.type);
  const std::pair<int64_t, int64_t> all[] = {{strides.x, dims.x - 1},
                                             {strides.y, dims.y - 1},
                                             {strides.z, dims.z - 1},
                                             {strides.component, layout.components - 1}};
  for (const auto& [step, count] : all) {
    int64_t bytes = 0;
    if (__builtin_mul_overflow(step, count, &bytes) || __builtin_add_overflow(end, bytes, &end))
      return std::nullopt;
  }
  return static_cast<uint64_t>(end);
}

auto too_large(const std::string& name) {
  return bad_input(name, "the volume is too large: expected at most 2^62 voxels");
}

}  // namespace

Strides Strides::packed(Index3 dims, const SampleLayout& layout) {
  const auto voxel = static_cast<uint64_t>(layout.bytes_per_voxel());
  const uint64_t row = voxel * static_cast<uint64_t>(dims.x), slice = row * static_cast<uint64_t>(dims.y);
  return {static_cast<int64_t>(voxel), static_cast<int64_t>(row), static_cast<int64_t>(slice),
          sample_bytes(layout.type)};
}

Result<std::unique_ptr<VolumeSource>> strided_source(std::shared_ptr<const MappedFile> file, uint64_t offset,
                                                     const Strides& strides, const VolumeInfo& info,
                                                     const SampleLayout& layout, const OpenOptions& options,
                                                     Context& ctx) {
  if (!checked_voxels(info.dims)) return too_large(file->name());
  if (strides == Strides::packed(info.dims, layout))
    return mapped_source(std::move(file), offset, info, layout, options, ctx);
  const auto needed = extent(strides, info.dims, layout);
  if (!needed) return too_large(file->name());
  const uint64_t found = file->bytes().size() - std::min<uint64_t>(file->bytes().size(), offset);
  if (*needed > found)
    return bad_input(file->name(), fmt::format("voxel data at byte {} end after {} bytes: expected {}",
                                               offset, found, *needed));
  if (!is_wide(layout.type) && layout.type != SampleType::f64)
    return std::make_unique<StridedSource>(std::move(file), offset, strides, info, layout);
  TemporaryFile ordered(file->name());
  std::vector<std::byte> row(
      static_cast<size_t>(std::min(info.dims.x, batch_voxels) * layout.bytes_per_voxel()));
  for (int64_t z = 0; z < info.dims.z; ++z)
    for (int64_t y = 0; y < info.dims.y; ++y) {
      VOX_CHECK(check_interrupt());
      for (int64_t x = 0; x < info.dims.x; x += batch_voxels) {
        const int64_t n = std::min(batch_voxels, info.dims.x - x);
        gather_row(file->bytes().data() + offset + x * strides.x + y * strides.y + z * strides.z, strides,
                   layout, n, row.data());
        VOX_CHECK(ordered.write({row.data(), static_cast<size_t>(n * layout.bytes_per_voxel())}));
      }
    }
  VOX_TRY(auto mapped, ordered.map());
  return mapped_source(std::move(mapped), 0, info, layout, options, ctx);
}

Result<std::unique_ptr<VolumeSource>> strided_source(std::unique_ptr<InputStream> stream,
                                                     const Strides& strides, const VolumeInfo& info,
                                                     const SampleLayout& layout, const OpenOptions& options,
                                                     Context& ctx) {
  if (!checked_voxels(info.dims)) return too_large(stream->name());
  if (strides == Strides::packed(info.dims, layout))
    return streamed_source(std::move(stream), info, layout, options, ctx);
  const auto needed = extent(strides, info.dims, layout);
  if (!needed) return too_large(stream->name());
  TemporaryFile file(stream->name());
  std::vector<std::byte> buffer(size_t{1} << 20);
  for (uint64_t done = 0; done < *needed;) {
    VOX_CHECK(check_interrupt());
    const auto want =
        std::span(buffer).first(static_cast<size_t>(std::min<uint64_t>(buffer.size(), *needed - done)));
    VOX_TRY(const size_t got, stream->read(want));
    VOX_CHECK(file.write(want.first(got)));
    done += got;
    if (got < want.size())
      return bad_input(stream->name(),
                       fmt::format("voxel data end after {} bytes: expected {}", done, *needed));
  }
  VOX_TRY(auto mapped, file.map());
  return strided_source(std::move(mapped), 0, strides, info, layout, options, ctx);
}

}  // namespace voxkit
