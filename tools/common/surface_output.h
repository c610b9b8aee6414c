// Compressed surfaces as files of points, of models, of meshes and of sparse grids.
#pragma once

#include <string>
#include <vector>

#include "libcolor/edit/levels.h"

namespace voxkit::cli {

/// Whether a surface can be written as a file of that name: .ply, .vox, .glb, .obj or .vdb. All but the last
/// hold nothing else.
bool is_surface_output(const std::string& name);
bool is_only_surface_output(const std::string& name);
/// The files of a name that is_only_surface_output: one, but for .obj.
std::vector<std::string> files_of_surface(const std::string& name);

/// What of a surface is written, and how.
struct SurfaceOutput {
  Box box;               ///< of the level's voxels
  bool enclosed = true;  ///< of meshes: also voxels without a face toward void
};
/// What came of it.
struct SurfaceCount {
  uint64_t voxels = 0;
  uint64_t faces = 0, enclosed = 0;  ///< of meshes: rectangles, and voxels that have none
};

/// Writes the voxels of a level of a surface that are in a box. As .ply: points where their centres are, as
/// doubles where floats cannot tell them apart, with all attributes as properties; other files have none, and
/// ctx.note says which are dropped. As .vdb: the active voxels of a Vec3s grid. As .vox: models;
/// where there are more than 255 colours, each becomes the nearest of a palette. As .glb and .obj: their
/// faces toward void and the sides of the box, merged into rectangles, and the voxels that have none as
/// points.
///
/// Memory: of .vdb, 6 KiB for each cube of 8 voxels a side that has any; of .vox, 11 bytes a voxel and 64
/// MiB; of meshes a quarter of ctx.memory at most for voxels (surface_faces.h), and the texture.
Result<SurfaceCount> write_surface(const color::Level& level, const SurfaceOutput& what,
                                   const std::string& name, bool force, Context& ctx);

}  // namespace voxkit::cli
