#include "tools/common/surface_input.h"

#include <fmt/format.h>

#include <algorithm>

#include "formats/mesh/mesh.h"
#include "formats/mesh/point_cloud.h"
#include "formats/volume/readers.h"
#include "libcolor/edit/levels.h"
#include "libcolor/surface/point_surface.h"
#include "libcolor/surface/volume_surface.h"
#include "libcolor/surface/voxel_list.h"
#include "libcolor/surface/voxelise.h"
#include "libcolor/terrain/terrain.h"

namespace voxkit::cli {
namespace {

using Surface = Result<std::unique_ptr<color::SurfaceSource>>;

/// What has no voxels before it is put into a grid.
Surface voxelise(const std::string& name, const SurfaceOptions& options, Context& ctx) {
  color::VoxeliseOptions voxelise;
  voxelise.kind = options.kind;
  voxelise.emission = options.emission;
  voxelise.resolution = options.resolution;
  voxelise.attributes = options.attributes;
  const auto is_wanted = [&](color::Attribute a) { return options.attributes && options.attributes->has(a); };
  if (is_points_name(name)) {
    PointExtras extras;
    extras.alpha = !options.attributes || is_wanted(color::Attribute::opacity);
    extras.normals = is_wanted(color::Attribute::normal);
    extras.rm = is_wanted(color::Attribute::rm);
    extras.labels = is_wanted(color::Attribute::id);
    VOX_TRY(auto points, open_points(name, extras));
    if (points)
      return color::surface_of_points(
          std::move(points), options.resolution.value_or(color::default_resolution), ctx, options.attributes);
  }
  VOX_TRY(Mesh mesh, read_mesh(name, ctx,
                               {.allow_outside = options.open.allow_outside,
                                .normals = is_wanted(color::Attribute::normal),
                                .rm = is_wanted(color::Attribute::rm)}));
  return color::make_surface(std::move(mesh), voxelise, ctx);
}

tl::unexpected<Error> has_voxels(const std::string& name) {
  return fail(ErrorCode::usage, name, "--resolution: has voxels already: expected a mesh");
}

/// What has been compressed before, at a resolution that it has.
Surface reopened(const std::string& name, std::shared_ptr<const color::Volume> volume,
                 std::optional<int64_t> resolution) {
  const auto resolution_of = [&](int level) {
    const Index3 dims = color::level_info(volume->info(), level).dims;
    return std::max({dims.x, dims.y, dims.z});
  };
  const int levels = color::level_count(volume->info());
  int level = 0;
  while (resolution && level < levels && resolution_of(level) != *resolution) ++level;
  if (level < levels) return color::surface_of(std::move(volume), level, color::CellColors::means);
  std::string possible;
  for (level = 0; level < levels; ++level)
    possible += (level == 0 ? "" : level + 1 < levels ? ", " : " or ") + std::to_string(resolution_of(level));
  return fail(ErrorCode::usage, name,
              fmt::format("--resolution {}: has voxels already, which can be halved: expected {}",
                          *resolution, possible));
}

Surface open_any(const std::string& name, const SurfaceOptions& options, Context& ctx) {
  if (options.frame && !has_ending(name, ".vox"))
    return fail(ErrorCode::usage, name, "--frame: is no animated model: expected a .vox file");
  if (is_mesh_name(name) || is_points_name(name)) return voxelise(name, options, ctx);
  const bool may_be_compressed = has_ending(name, ".dagc") || name == "-";
  if (options.resolution && !may_be_compressed) return has_voxels(name);
  if (color::is_terrain(name)) return color::open_terrain(name);
  if (has_ending(name, ".vox")) {
    VOX_TRY(VoxelScene scene, read_magicavoxel(name, ctx, options.frame.value_or(0)));
    return color::surface_of(std::move(scene), ctx, options.attributes, options.emission);
  }
  OpenOptions open = options.open;
  open.other_kinds += "meshes (.obj .gltf .glb .ply .stl .3ds), points (.ply .pcd .las), models (.vox), ";
  VOX_TRY(Input input, open_input(name, open, ctx));
  if (input.color) return reopened(name, std::move(input.color), options.resolution);
  if (options.resolution) return has_voxels(name);
  // Built-ins are opaque.
  std::optional<color::AttributeSet> wanted = options.attributes;
  if (!wanted && is_builtin(name)) wanted.emplace();
  return color::surface_of(std::move(input.source), wanted, ctx);
}

}  // namespace

Surface open_surface(const std::string& name, const SurfaceOptions& options, Context& ctx) {
  Surface surface = open_any(name, options, ctx);
  if (!surface && surface.error().file.empty()) return fail(surface.error().code, name, surface.error().what);
  return surface;
}

}  // namespace voxkit::cli
