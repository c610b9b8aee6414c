#include "tools/common/surface_input.h"

#include <fmt/format.h>

#include <algorithm>

#include "formats/mesh/joined_points.h"
#include "formats/mesh/mesh.h"
#include "formats/mesh/mesh_join.h"
#include "formats/mesh/point_cloud.h"
#include "formats/volume/readers.h"
#include "libcolor/edit/levels.h"
#include "libcolor/surface/point_surface.h"
#include "libcolor/surface/volume_surface.h"
#include "libcolor/surface/voxel_list.h"
#include "libcolor/surface/voxelise.h"
#include "libcolor/terrain/terrain.h"
#include "tools/common/attributes.h"

namespace voxkit::cli {
namespace {

using Surface = Result<std::unique_ptr<color::SurfaceSource>>;

color::VoxeliseOptions voxelise_options(const SurfaceOptions& options) {
  color::VoxeliseOptions voxelise;
  voxelise.kind = options.kind;
  voxelise.emission = options.emission;
  voxelise.resolution = options.resolution;
  voxelise.attributes = options.attributes;
  return voxelise;
}

bool is_wanted(const SurfaceOptions& options, color::Attribute attribute) {
  return options.attributes && options.attributes->has(attribute);
}

PointExtras point_extras(const SurfaceOptions& options) {
  PointExtras extras;
  extras.alpha = !options.attributes || is_wanted(options, color::Attribute::opacity);
  extras.emission =
      options.emission && (!options.attributes || is_wanted(options, color::Attribute::emissive));
  extras.normals = is_wanted(options, color::Attribute::normal);
  extras.rm = is_wanted(options, color::Attribute::rm);
  extras.labels = is_wanted(options, color::Attribute::id);
  return extras;
}

MeshOptions mesh_options(const SurfaceOptions& options) {
  return {.allow_outside = options.open.allow_outside,
          .normals = is_wanted(options, color::Attribute::normal),
          .rm = is_wanted(options, color::Attribute::rm)};
}

/// What has no voxels before it is put into a grid.
Surface voxelise(const std::string& name, const SurfaceOptions& options, Context& ctx) {
  if (is_points_name(name)) {
    VOX_TRY(auto points, open_points(name, point_extras(options)));
    if (points)
      return color::surface_of_points(std::move(points), options.resolution, ctx, options.attributes);
  }
  VOX_TRY(Mesh mesh, read_mesh(name, ctx, mesh_options(options)));
  return color::make_surface(std::move(mesh), voxelise_options(options), ctx);
}

/// Errors without a file name this one.
template <class T>
Result<T> named(Result<T> made, const std::string& name) {
  if (!made && made.error().file.empty()) return fail(made.error().code, name, made.error().what);
  return made;
}

/// Points of all kinds, and meshes: these are what `meshes` of them are.
Surface joined(std::vector<PlacedPoints> clouds, std::vector<Mesh> meshes, const SurfaceOptions& options,
               Context& ctx) {
  if (meshes.empty())
    return color::surface_of_points(join_points(std::move(clouds)), options.resolution, ctx,
                                    options.attributes);
  for (PlacedPoints& cloud : clouds) {
    VOX_TRY(Mesh mesh, mesh_of_points(*cloud.points, ctx));
    move_mesh(mesh, cloud.by);
    for (std::string& note : mesh.notes) note = cloud.prefix + note;
    meshes.push_back(std::move(mesh));
    cloud.points.reset();
  }
  if (meshes.size() > 1) {
    VOX_TRY(Mesh all, join_meshes(std::move(meshes), ctx));
    return color::make_surface(std::move(all), voxelise_options(options), ctx);
  }
  return color::make_surface(std::move(meshes.front()), voxelise_options(options), ctx);
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

bool is_surface_file(const std::string& name) {
  return is_mesh_name(name) || is_points_name(name) || has_ending(name, ".vox");
}

Surface open_surface(const std::string& name, const SurfaceOptions& options, Context& ctx) {
  Surface surface = named(open_any(name, options, ctx), name);
  if (!surface) return surface;
  return with_wanted(std::move(*surface), options.attributes, name);
}

Surface open_surfaces(std::span<const PlacedInput> inputs, const SurfaceOptions& options, Context& ctx) {
  const PlacedInput& first = inputs.front();
  if (inputs.size() == 1 && !first.at) return open_surface(first.name, options, ctx);
  for (const PlacedInput& input : inputs) {
    if (is_mesh_name(input.name) || is_points_name(input.name)) continue;
    return fail(ErrorCode::usage, input.name,
                inputs.size() == 1
                    ? "--at: moves a mesh or points: expected one of these"
                    : "is no mesh and no points: expected these as several inputs (vox-convert "
                      "--merge puts .dagc files together)");
  }
  if (options.frame)
    return fail(ErrorCode::usage, first.name, "--frame: is no animated model: expected a .vox file");
  std::vector<PlacedPoints> clouds;
  std::vector<const PlacedInput*> meshes_of, clouds_of;
  const auto prefix_of = [&](const PlacedInput& input) { return inputs.size() > 1 ? input.name + ": " : ""; };
  const auto by = [](const PlacedInput& input) { return input.at.value_or(glm::dvec3(0)); };
  for (const PlacedInput& input : inputs) {
    if (is_points_name(input.name)) {
      VOX_TRY(auto points, named(open_points(input.name, point_extras(options)), input.name));
      if (points) {
        clouds.push_back({std::move(points), by(input), prefix_of(input)});
        clouds_of.push_back(&input);
        continue;
      }
    }
    meshes_of.push_back(&input);
  }
  if (!meshes_of
           .empty())  // points of meshes have places, colours and opacities: the rest is named as dropped
    for (size_t i = 0; i < clouds.size(); ++i) {
      for (const color::Attribute a :
           {color::Attribute::emissive, color::Attribute::normal, color::Attribute::rm, color::Attribute::id})
        if (is_wanted(options, a))
          return fail(
              ErrorCode::usage, clouds_of[i]->name,
              fmt::format("--attributes: points beside a mesh have no {}: expected color and opacity, or a "
                          "file for each",
                          color::kind_of(a).name));
      const PointExtras opacity{.alpha = point_extras(options).alpha};
      VOX_TRY(clouds[i].points, named(open_points(clouds_of[i]->name, opacity), clouds_of[i]->name));
    }
  std::vector<Mesh> meshes;
  for (const PlacedInput* input : meshes_of) {
    VOX_TRY(Mesh mesh, named(read_mesh(input->name, ctx, mesh_options(options)), input->name));
    move_mesh(mesh, by(*input));
    if (mesh.grid && inputs.size() > 1)
      mesh.notes.push_back("its own grid of voxels is dropped: there is one around all inputs");
    for (std::string& note : mesh.notes) note = prefix_of(*input) + note;
    meshes.push_back(std::move(mesh));
  }
  const std::string name = inputs.size() == 1 ? first.name : "";
  Surface surface = named(joined(std::move(clouds), std::move(meshes), options, ctx), name);
  if (!surface) return surface;
  return with_wanted(std::move(*surface), options.attributes, name);
}

}  // namespace voxkit::cli
