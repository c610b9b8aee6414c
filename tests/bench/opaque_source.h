// A volume as its surface: voxels are void or opaque, so that "the first voxel on a ray" is all that a
// picture needs.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "formats/source.h"

namespace voxkit::bench {

/// Any volume as RGBA of alpha 0 or 255. Solid are: of RGBA, voxels of alpha > 0; of RGB, those that are not
/// black; of scalars, stored values of at least `iso`, as greys from 0 to 255 over `range`.
class OpaqueSource : public VolumeSource {
 public:
  OpaqueSource(std::unique_ptr<VolumeSource> source, double iso, const ValueRange& range)
      : source_(std::move(source)), format_(source_->info().format), iso_(iso), range_(range) {
    info_ = source_->info();
    info_.format = VoxelFormat::rgba32;
    info_.range.reset();
  }
  bool forward_only() const override { return source_->forward_only(); }
  Status read(const Box& box, VoxelSpan out) override {
    const Index3 size = box.size();
    const int64_t bytes = voxel_bytes(format_);
    std::vector<std::byte> memory(static_cast<size_t>(size.x * size.y * size.z * bytes));
    const VoxelSpan in = packed(memory.data(), size, format_);
    VOX_CHECK(source_->read(box, in));
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y)
        for (int64_t x = 0; x < size.x; ++x) {
          Voxel voxel;
          std::copy_n(in.row(y, z) + x * bytes, bytes, voxel.bytes.begin());
          const Voxel solid = opaque(voxel);
          std::copy_n(solid.bytes.begin(), 4, out.row(y, z) + x * 4);
        }
    return {};
  }
  std::optional<Voxel> uniform(const Box& box) const override {
    const std::optional<Voxel> voxel = source_->uniform(box);
    return voxel ? std::optional(opaque(*voxel)) : std::nullopt;
  }
  void expect(int64_t z0, int64_t z1) const override { source_->expect(z0, z1); }
  void release(int64_t z0, int64_t z1) const override { source_->release(z0, z1); }

 private:
  Voxel opaque(const Voxel& v) const {
    Voxel out;
    if (format_ == VoxelFormat::rgba32 || format_ == VoxelFormat::rgb24) {
      if (format_ == VoxelFormat::rgba32 ? v.bytes[3] == std::byte{0} : v == Voxel{}) return out;
      std::copy_n(v.bytes.begin(), 3, out.bytes.begin());
    } else {
      const double value = scalar(v);
      if (!(value >= iso_)) return out;
      const double extent = range_.hi > range_.lo ? range_.hi - range_.lo : 1;
      const double grey = std::clamp((value - range_.lo) / extent, 0.0, 1.0);
      std::fill_n(out.bytes.begin(), 3, static_cast<std::byte>(std::lround(255 * grey)));
    }
    out.bytes[3] = std::byte{255};
    return out;
  }
  double scalar(const Voxel& v) const {
    switch (format_) {
      case VoxelFormat::density16:
        return v.as<uint16_t>();
      case VoxelFormat::float32:
        return static_cast<double>(v.as<float>());
      default:
        return std::to_integer<int>(v.bytes[0]);
    }
  }

  std::unique_ptr<VolumeSource> source_;
  VoxelFormat format_;
  double iso_;
  ValueRange range_;
};

}  // namespace voxkit::bench
