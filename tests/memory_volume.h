// Volumes in memory, for tests: a source, one that is read front to back, and a sink.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "formats/source.h"

namespace voxkit::test {

class MemorySource : public VolumeSource {
 public:
  MemorySource(const VolumeInfo& info, std::vector<std::byte> voxels) : voxels_(std::move(voxels)) {
    info_ = info;
  }
  Status read(const Box& box, VoxelSpan out) override {
    if (!info_.box().contains(box) || box.empty())
      return fail(ErrorCode::internal, {}, "box outside the volume");
    const auto all = packed(static_cast<const std::byte*>(voxels_.data()), info_.dims, info_.format);
    copy({all.row(box.lo.y, box.lo.z) + box.lo.x * voxel_bytes(info_.format), all.row_stride,
          all.slice_stride},
         out, box.size(), info_.format);
    voxels_read += box.voxels();
    return {};
  }
  std::atomic<int64_t> voxels_read{0};

 protected:
  std::vector<std::byte> voxels_;
};

/// Fails where the rules of forward-only sources are broken.
class ForwardSource : public MemorySource {
 public:
  using MemorySource::MemorySource;
  bool forward_only() const override { return true; }
  Status read(const Box& box, VoxelSpan out) override {
    if (box.lo.x != 0 || box.lo.y != 0 || box.hi.x != info_.dims.x || box.hi.y != info_.dims.y ||
        box.lo.z < next_)
      return fail(ErrorCode::internal, {}, "not front to back");
    next_ = box.hi.z;
    return MemorySource::read(box, out);
  }

 private:
  int64_t next_ = 0;
};

/// A volume of one value, which says so.
class FlatSource : public VolumeSource {
 public:
  FlatSource(const VolumeInfo& info, const Voxel& value) : value_(value) { info_ = info; }
  Status read(const Box&, VoxelSpan) override {
    return fail(ErrorCode::internal, {}, "read what is uniform");
  }
  std::optional<Voxel> uniform(const Box&) const override { return value_; }

 private:
  Voxel value_;
};

class MemorySink : public VolumeSink {
 public:
  MemorySink(Index3 dims, VoxelFormat format) : dims_(dims), format_(format) {}
  Status write(int64_t z0, int64_t z1, ConstVoxelSpan in) override {
    if (z0 != next_ || z1 > dims_.z || finished) return fail(ErrorCode::internal, {}, "slabs out of order");
    const size_t old = voxels.size(),
                 bytes = static_cast<size_t>(dims_.x * dims_.y * (z1 - z0) * voxel_bytes(format_));
    voxels.resize(old + bytes);
    copy(in, packed(voxels.data() + old, {dims_.x, dims_.y, z1 - z0}, format_), {dims_.x, dims_.y, z1 - z0},
         format_);
    next_ = z1;
    return {};
  }
  Status finish() override {
    finished = next_ == dims_.z;
    return finished ? Status{} : Status(fail(ErrorCode::internal, {}, "slabs are missing"));
  }
  std::vector<std::byte> voxels;
  bool finished = false;

 private:
  Index3 dims_;
  VoxelFormat format_;
  int64_t next_ = 0;
};

inline VolumeInfo scalar_info(Index3 dims, SampleType type) {
  VolumeInfo info;
  info.dims = dims;
  info.sample_type = type;
  info.format = scalar_format(type);
  return info;
}
inline VolumeInfo color_info(Index3 dims, VoxelFormat format) {
  VolumeInfo info;
  info.dims = dims;
  info.format = format;
  return info;
}

template <class T>
std::vector<std::byte> bytes_of(const std::vector<T>& values) {
  const auto bytes = std::as_bytes(std::span(values));
  return {bytes.begin(), bytes.end()};
}
template <class T>
std::unique_ptr<VolumeSource> volume(const VolumeInfo& info, const std::vector<T>& values) {
  return std::make_unique<MemorySource>(info, bytes_of(values));
}

/// All voxels of a source, read box by box of the given size, as T.
template <class T>
std::vector<T> read_all(VolumeSource& source, Index3 step = Index3(1 << 20)) {
  const VolumeInfo& info = source.info();
  std::vector<T> out(static_cast<size_t>(info.box().voxels() * voxel_bytes(info.format)) / sizeof(T));
  const VoxelSpan all = packed(reinterpret_cast<std::byte*>(out.data()), info.dims, info.format);
  for (int64_t z = 0; z < info.dims.z; z += step.z)
    for (int64_t y = 0; y < info.dims.y; y += step.y)
      for (int64_t x = 0; x < info.dims.x; x += step.x) {
        const Box box = intersect({{x, y, z}, Index3(x, y, z) + step}, info.box());
        const Status status = source.read(
            box, {all.row(y, z) + x * voxel_bytes(info.format), all.row_stride, all.slice_stride});
        if (!status) return {};
      }
  return out;
}

}  // namespace voxkit::test
