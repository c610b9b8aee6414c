// Voxels in memory as a coloured surface: models that are voxels already, and points.
#pragma once

#include <memory>
#include <vector>

#include "formats/magicavoxel.h"
#include "formats/mesh.h"
#include "libcolor/surface.h"

namespace voxkit::color {

/// The voxels of a scene; the box around them becomes the volume, placed where it is in the scene.
/// ErrorCode::input: there are none, or its sides are above 2^21.
Result<std::unique_ptr<SurfaceSource>> surface_of(VoxelScene scene, Context& ctx);

/// The vertices of a mesh without triangles, as points of no size, in a grid with `resolution` voxels, 1 to
/// 2^21, along their longest side: a voxel has the mean of its points' colours in linear light, rounded once;
/// points without colours are white. ErrorCode::usage for the resolution, ErrorCode::input for a point that
/// is not finite.
Result<std::unique_ptr<SurfaceSource>> surface_of_points(Mesh points, int64_t resolution, Context& ctx);

}  // namespace voxkit::color
