// Reading an uncompressed volume to draw it.
#include "librender/cast/grid.h"

namespace voxkit::render {

Result<std::shared_ptr<const DenseGrid>> DenseGrid::read(VolumeSource& source, Context& ctx) {
  auto grid = std::make_shared<DenseGrid>();
  grid->info_ = source.info();
  const int bytes = voxel_bytes(grid->info_.format);
  const auto voxels = checked_voxels(grid->info_.dims);
  if (!voxels || *voxels > uint64_t{1} << 56)
    return fail(ErrorCode::limit, {}, "the volume is too large to render uncompressed");
  VOX_TRY(grid->buffer_, Buffer::allocate(*voxels * static_cast<uint64_t>(bytes) + DenseView::read_slack,
                                          "the volume", ctx));
  const VoxelSpan all = packed(grid->buffer_->data(), grid->info_.dims, grid->info_.format);
  const Slabs slabs(grid->info_.box(), bytes, slab_target(ctx));
  for (int64_t i = 0; i < slabs.count(); ++i) {
    VOX_CHECK(check_interrupt());
    const Box slab = slabs.slab(i);
    source.expect(slab.lo.z, slab.hi.z);
    VOX_CHECK(read_slab(source, slab, {all.row(0, slab.lo.z), all.row_stride, all.slice_stride}, ctx));
    source.release(slab.lo.z, slab.hi.z);
    ctx.progress(static_cast<double>(slab.hi.z) / static_cast<double>(grid->info_.dims.z));
  }
  return grid;
}

}  // namespace voxkit::render
