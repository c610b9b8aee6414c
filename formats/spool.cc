#include "formats/spool.h"

#include <cstring>

#include "formats/copy.h"
#include "formats/mapped_file.h"

namespace voxkit {
namespace {

class SpooledSource final : public VolumeSource {
 public:
  SpooledSource(const VolumeInfo& info, std::shared_ptr<const MappedFile> file) : file_(std::move(file)) {
    info_ = info;
  }
  Status read(const Box& box, VoxelSpan out) override {
    const ConstVoxelSpan all = packed(file_->bytes().data(), info_.dims, info_.format);
    copy({all.row(box.lo.y, box.lo.z) + box.lo.x * voxel_bytes(info_.format), all.row_stride,
          all.slice_stride},
         out, box.size(), info_.format);
    return {};
  }
  void expect(int64_t z0, int64_t z1) const override { expect_bytes(slices(z0, z1)); }
  void release(int64_t z0, int64_t z1) const override { release_bytes(slices(z0, z1)); }

 private:
  std::span<const std::byte> slices(int64_t z0, int64_t z1) const {
    const int64_t slice = info_.dims.x * info_.dims.y * voxel_bytes(info_.format);
    return file_->bytes().subspan(static_cast<size_t>(z0 * slice), static_cast<size_t>((z1 - z0) * slice));
  }
  std::shared_ptr<const MappedFile> file_;
};

}  // namespace

Result<std::unique_ptr<VolumeSource>> VolumeSpool::finish() {
  VOX_TRY(auto mapped, file_.map());
  return std::make_unique<SpooledSource>(info_, std::move(mapped));
}

Result<std::unique_ptr<VolumeSource>> spooled(std::unique_ptr<VolumeSource> source, Context& ctx) {
  if (!source->forward_only()) return source;
  const VolumeInfo& info = source->info();
  const Slabs slabs(info.box(), voxel_bytes(info.format), slab_target(ctx));
  VOX_TRY(const auto buffer, Buffer::allocate(slabs.bytes(), "a slab of voxels", ctx));
  VolumeSpool spool(info);
  for (int64_t i = 0; i < slabs.count(); ++i) {
    VOX_CHECK(check_interrupt());
    const Box slab = slabs.slab(i);
    VOX_CHECK(source->read(slab, packed(buffer->data(), slab.size(), info.format)));
    VOX_CHECK(spool.write({buffer->data(), static_cast<size_t>(slab.voxels() * voxel_bytes(info.format))}));
  }
  return spool.finish();
}

}  // namespace voxkit
