#include "tools/common/surface_input.h"

#include "formats/mesh/mesh.h"
#include "formats/mesh/point_cloud.h"
#include "formats/volume/readers.h"
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
  if (options.resolution) voxelise.resolution = *options.resolution;
  if (is_points_name(name)) {
    VOX_TRY(auto points, open_points(name));
    if (points) return color::surface_of_points(std::move(points), voxelise.resolution, ctx);
  }
  VOX_TRY(Mesh mesh, read_mesh(name, ctx, {.allow_outside = options.open.allow_outside}));
  return color::make_surface(std::move(mesh), voxelise, ctx);
}

Surface open_any(const std::string& name, const SurfaceOptions& options, Context& ctx) {
  if (options.frame && !has_ending(name, ".vox"))
    return fail(ErrorCode::usage, name, "--frame: is no animated model: expected a .vox file");
  if (is_mesh_name(name) || is_points_name(name)) return voxelise(name, options, ctx);
  if (options.resolution)
    return fail(ErrorCode::usage, name, "--resolution: has voxels already: expected a mesh");
  if (color::is_terrain(name)) return color::open_terrain(name);
  if (has_ending(name, ".vox")) {
    VOX_TRY(VoxelScene scene, read_magicavoxel(name, ctx, options.frame.value_or(0)));
    return color::surface_of(std::move(scene), ctx);
  }
  OpenOptions open = options.open;
  open.other_kinds += "meshes (.obj .gltf .glb .ply .stl .3ds), points (.ply .pcd .las), models (.vox), ";
  VOX_TRY(Input input, open_input(name, open, ctx));
  return color::surface_of(std::move(input.source));
}

}  // namespace

Surface open_surface(const std::string& name, const SurfaceOptions& options, Context& ctx) {
  Surface surface = open_any(name, options, ctx);
  if (!surface && surface.error().file.empty()) return fail(surface.error().code, name, surface.error().what);
  return surface;
}

}  // namespace voxkit::cli
