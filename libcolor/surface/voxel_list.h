// Voxels in memory as a coloured surface: models that are voxels already.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "formats/mesh/magicavoxel.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// The voxels of a scene; the box around them becomes the volume, placed where it is in the scene.
/// ErrorCode::input: there are none, or its sides are above 2^21.
///
/// `attributes`: what voxels have beside colours, of their materials: emissive is the share of its colour
/// that one gives as light, and is in the colour already, which stays as it is; the id is the number of its
/// colour. Not said: emissive and opacity where one of its materials has that; emissive only if `emission`.
/// ErrorCode::usage for normals, which there are not.
Result<std::unique_ptr<SurfaceSource>> surface_of(VoxelScene scene, Context& ctx,
                                                  const std::optional<AttributeSet>& attributes = {},
                                                  bool emission = true);

}  // namespace voxkit::color
