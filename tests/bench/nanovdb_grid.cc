#include <nanovdb/NanoVDB.h>
#include <nanovdb/util/GridBuilder.h>

#include <algorithm>
#include <cstring>

#include "formats/copy.h"
#include "tests/bench/nanovdb_cast.h"

namespace voxkit::bench {
namespace {

class BuiltGrid : public NanovdbGrid {
 public:
  BuiltGrid(const VolumeInfo& info, nanovdb::GridHandle<> handle) : handle_(std::move(handle)) {
    info_ = info;
  }
  const void* data() const override { return handle_.grid<nanovdb::Rgba8>(); }
  uint64_t bytes() const override { return handle_.size(); }

 private:
  nanovdb::GridHandle<> handle_;
};

}  // namespace

Result<std::shared_ptr<const NanovdbGrid>> NanovdbGrid::build(VolumeSource& source, Context& ctx) {
  const VolumeInfo& info = source.info();
  if (info.format != VoxelFormat::rgba32)
    return fail(ErrorCode::internal, {}, "a volume that is not RGBA: expected one that is");
  constexpr int64_t leaf = 8;
  VOX_TRY(const auto slab_memory,
          Buffer::allocate(static_cast<uint64_t>(info.dims.x * info.dims.y * leaf * 4), "a slab", ctx));
  nanovdb::GridBuilder<nanovdb::Rgba8> builder(nanovdb::Rgba8{});
  builder.setStats(nanovdb::StatsMode::BBox);
  builder.setChecksum(nanovdb::ChecksumMode::Disable);
  for (int64_t z0 = 0; z0 < info.dims.z; z0 += leaf) {
    const int64_t z1 = std::min(z0 + leaf, info.dims.z);
    const VoxelSpan slab = packed(slab_memory->data(), {info.dims.x, info.dims.y, z1 - z0}, info.format);
    VOX_CHECK(check_interrupt());
    VOX_CHECK(read_slab(source, {{0, 0, z0}, {info.dims.x, info.dims.y, z1}}, slab, ctx));
    const auto corner = [](int64_t x, int64_t y, int64_t z) {
      return nanovdb::Coord(static_cast<int>(x), static_cast<int>(y), static_cast<int>(z));
    };
    builder(
        [&](const nanovdb::Coord& v) {
          nanovdb::Rgba8 value;
          std::memcpy(&value.packed(), slab.row(v.y(), v.z() - z0) + v.x() * 4, 4);
          return value;
        },
        nanovdb::CoordBBox(corner(0, 0, z0), corner(info.dims.x - 1, info.dims.y - 1, z1 - 1)));
    ctx.progress(static_cast<double>(z1) / static_cast<double>(info.dims.z));
  }
  return std::make_shared<BuiltGrid>(info, builder.getHandle());
}

}  // namespace voxkit::bench
