// Compressed surfaces as files of points, of models and of sparse grids.
#pragma once

#include <string>

#include "libcolor/surface/surface.h"

namespace voxkit::cli {

/// Whether a surface can be written as a file of that name: .ply, .vox or .vdb. The first two hold nothing
/// else.
bool is_surface_output(const std::string& name);
bool is_only_surface_output(const std::string& name);

/// Writes all voxels of a surface, of which there are `count`, and which can be read more than once. As .ply:
/// points where their centres are, as doubles where floats cannot tell them apart. As .vdb: the active voxels
/// of a Vec3s grid. As .vox: models; where there are more than 255 colours, each becomes the nearest of a
/// palette. Memory: of .vdb, 6 KiB for each cube of 8 voxels a side that has any; of .vox, 11 bytes a voxel
/// and 64 MiB.
Status write_surface(color::SurfaceSource& surface, uint64_t count, const std::string& name, bool force,
                     Context& ctx);

}  // namespace voxkit::cli
