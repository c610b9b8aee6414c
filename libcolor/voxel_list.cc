#include "libcolor/voxel_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "libcolor/linear_light.h"
#include "libcolor/morton.h"

namespace voxkit::color {
namespace {

class VoxelList final : public SurfaceSource {
 public:
  /// `voxels` ascend strictly.
  VoxelList(VolumeInfo info, std::vector<SurfaceVoxel> voxels, Reservation memory)
      : voxels_(std::move(voxels)), memory_(std::move(memory)) {
    info_ = std::move(info);
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
    info.origin[a] = static_cast<double>(lo[static_cast<Index3::length_type>(a)]) + 0.5;
  if (std::max({info.dims.x, info.dims.y, info.dims.z}) > int64_t{1} << most_levels ||
      !checked_voxels(info.dims))
    return bad_input({}, fmt::format("a scene of {} x {} x {} voxels: expected at most {} a side",
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
  return std::make_unique<VoxelList>(std::move(info), std::move(voxels), std::move(memory));
}

Result<std::unique_ptr<SurfaceSource>> surface_of_points(Mesh points, int64_t resolution, Context& ctx) {
  if (resolution < 1 || resolution > int64_t{1} << most_levels)
    return bad_usage(
        fmt::format("a resolution of {}: expected 1 to {}", resolution, int64_t{1} << most_levels));
  if (points.positions.empty()) return bad_input({}, "no points");
  glm::dvec3 lo(INFINITY), hi(-INFINITY);
  for (const glm::dvec3& p : points.positions)
    for (int a = 0; a < 3; ++a) {
      constexpr double most = 3.5e38;
      if (!(std::abs(p[a]) <= most))
        return bad_input({},
                         fmt::format("a point at {}, {}, {}: expected finite coordinates", p.x, p.y, p.z));
      lo[a] = std::min(lo[a], p[a]);
      hi[a] = std::max(hi[a], p[a]);
    }
  const double longest = std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z});
  const double edge = longest > 0 ? longest / static_cast<double>(resolution) : 1;
  VolumeInfo info;
  for (int a = 0; a < 3; ++a) {
    const auto axis = static_cast<size_t>(a);
    info.dims[a] =
        std::clamp<int64_t>(static_cast<int64_t>(std::floor((hi[a] - lo[a]) / edge)) + 1, 1, resolution);
    info.spacing[axis] = edge;
    info.origin[axis] = lo[a] + edge / 2;
  }
  VOX_TRY(Reservation memory,
          Reservation::take(points.positions.size() * 2 * sizeof(SurfaceVoxel), "points, sorted", ctx));
  const LightTables& tables = light_tables();
  const auto stored = [&](float light) {
    return tables.stored[static_cast<size_t>(std::lrint(std::clamp(light, 0.0f, 1.0f) * full_light))];
  };
  std::vector<SurfaceVoxel> voxels;
  voxels.reserve(points.positions.size());
  for (size_t i = 0; i < points.positions.size(); ++i) {
    uint32_t at[3];
    for (int a = 0; a < 3; ++a)
      at[a] = static_cast<uint32_t>(std::clamp<int64_t>(
          static_cast<int64_t>(std::floor((points.positions[i][a] - lo[a]) / edge)), 0, info.dims[a] - 1));
    const glm::vec4 light = points.colors.empty() ? glm::vec4(1) : points.colors[i];
    voxels.push_back({morton_code(at[0], at[1], at[2]), {stored(light.x), stored(light.y), stored(light.z)}});
  }
  std::sort(voxels.begin(), voxels.end(), by_place);
  size_t kept = 0;
  for (size_t i = 0; i < voxels.size();) {
    uint64_t sum[3] = {}, count = 0;
    const uint64_t place = voxels[i].place;
    for (; i < voxels.size() && voxels[i].place == place; ++i, ++count) {
      sum[0] += tables.linear[voxels[i].color.r];
      sum[1] += tables.linear[voxels[i].color.g];
      sum[2] += tables.linear[voxels[i].color.b];
    }
    const auto mean = [&](uint64_t light) { return tables.stored[(2 * light + count) / (2 * count)]; };
    voxels[kept++] = {place, {mean(sum[0]), mean(sum[1]), mean(sum[2])}};
  }
  voxels.resize(kept);
  return std::make_unique<VoxelList>(std::move(info), std::move(voxels), std::move(memory));
}

}  // namespace voxkit::color
