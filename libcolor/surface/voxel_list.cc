#include "libcolor/surface/voxel_list.h"

#include <fmt/format.h>

#include <algorithm>

#include "libcolor/surface/morton.h"

namespace voxkit::color {
namespace {

class VoxelList final : public SurfaceSource {
 public:
  /// `voxels` ascend strictly.
  VoxelList(VolumeInfo info, std::vector<SurfaceVoxel> voxels, Reservation memory,
            std::vector<std::string> notes)
      : voxels_(std::move(voxels)), memory_(std::move(memory)) {
    info_ = std::move(info);
    notes_ = std::move(notes);
    info_.format = VoxelFormat::rgba32;
  }
  Status read(Context&, const Sink& sink) override { return voxels_.empty() ? Status() : sink(voxels_); }

 private:
  std::vector<SurfaceVoxel> voxels_;
  Reservation memory_;
};

bool by_place(const SurfaceVoxel& a, const SurfaceVoxel& b) {
  return a.place < b.place;
}

}  // namespace

Result<std::unique_ptr<SurfaceSource>> surface_of(VoxelScene scene, Context& ctx) {
  if (scene.voxels.empty()) return bad_input({}, "no voxels");
  Index3 lo(INT32_MAX), hi(INT32_MIN);
  for (const ModelVoxel& voxel : scene.voxels)
    for (size_t a = 0; a < 3; ++a) {
      const auto axis = static_cast<Index3::length_type>(a);
      lo[axis] = std::min<int64_t>(lo[axis], voxel.place[a]);
      hi[axis] = std::max<int64_t>(hi[axis], voxel.place[a]);
    }
  VolumeInfo info;
  info.dims = hi - lo + Index3(1);
  for (size_t a = 0; a < 3; ++a)
    info.affine.origin[a] = static_cast<double>(lo[static_cast<Index3::length_type>(a)]) + 0.5;
  if (std::max({info.dims.x, info.dims.y, info.dims.z}) > int64_t{1} << most_levels ||
      !checked_voxels(info.dims))
    return bad_input(
        {}, fmt::format("a scene of {} x {} x {} voxels: expected at most {} a side, and 2^62 in all",
                        info.dims.x, info.dims.y, info.dims.z, 1 << most_levels));
  VOX_TRY(Reservation memory, Reservation::take(scene.voxels.size() * 2 * sizeof(SurfaceVoxel),
                                                "the voxels of a scene, sorted", ctx));
  std::vector<SurfaceVoxel> voxels;
  voxels.reserve(scene.voxels.size());
  for (const ModelVoxel& v : scene.voxels)
    voxels.push_back(
        {morton_code(static_cast<uint32_t>(v.place[0] - lo.x), static_cast<uint32_t>(v.place[1] - lo.y),
                     static_cast<uint32_t>(v.place[2] - lo.z)),
         {v.color[0], v.color[1], v.color[2]}});
  // Of several at one place the last one stays.
  std::stable_sort(voxels.begin(), voxels.end(), by_place);
  size_t kept = 0;
  for (size_t i = 0; i < voxels.size(); ++i)
    if (i + 1 == voxels.size() || voxels[i + 1].place != voxels[i].place) voxels[kept++] = voxels[i];
  voxels.resize(kept);
  return std::make_unique<VoxelList>(std::move(info), std::move(voxels), std::move(memory),
                                     std::move(scene.notes));
}

}  // namespace voxkit::color
