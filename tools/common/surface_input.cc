#include "tools/common/surface_input.h"

#include "libcolor/volume_surface.h"
#include "libcolor/voxelise.h"

namespace voxkit::cli {

Result<std::unique_ptr<color::SurfaceSource>> open_surface(const std::string& name,
                                                           const SurfaceOptions& options, Context& ctx) {
  if (is_mesh_name(name)) {
    color::VoxeliseOptions voxelise;
    voxelise.kind = options.kind;
    if (options.resolution) voxelise.resolution = *options.resolution;
    VOX_TRY(Mesh mesh, read_mesh(name, ctx));
    return color::make_surface(std::move(mesh), voxelise, ctx);
  }
  if (options.resolution)
    return fail(ErrorCode::usage, name, "--resolution: has voxels already: expected a mesh");
  VOX_TRY(Input input, open_input(name, options.open, ctx));
  auto surface = color::surface_of(std::move(input.source));
  if (!surface) return fail(surface.error().code, name, surface.error().what);
  return surface;
}

}  // namespace voxkit::cli
