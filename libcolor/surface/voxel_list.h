// Voxels in memory as a coloured surface: models that are voxels already.
#pragma once

#include <memory>
#include <vector>

#include "formats/mesh/magicavoxel.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// The voxels of a scene; the box around them becomes the volume, placed where it is in the scene.
/// ErrorCode::input: there are none, or its sides are above 2^21.
Result<std::unique_ptr<SurfaceSource>> surface_of(VoxelScene scene, Context& ctx);

}  // namespace voxkit::color
