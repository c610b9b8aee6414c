// MagicaVoxel models (.vox): coloured voxels in a scene of several models.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/reservation.h"
#include "formats/volume.h"

namespace voxkit {

/// A voxel of a scene: its place, and its colour as R, G, B in sRGB.
struct ModelVoxel {
  std::array<int32_t, 3> place;
  std::array<uint8_t, 3> color;
};

/// All voxels of a scene, models in the order in which they are placed: of several at one place the last one
/// counts. The axes are turned so that y points up, as renderers have it: x, z and -y of the file.
struct VoxelScene {
  std::vector<ModelVoxel> voxels;
  Reservation memory;  ///< of these, in ctx.memory
};

/// Reads version 150 and 200 files: sizes, voxels, palettes, and the scene's nodes with their first frames'
/// translations and rotations; what is hidden is left out. Places are within 2^20 of the origin. Errors:
/// ErrorCode::input with the byte where a rule is broken, ErrorCode::limit.
Result<VoxelScene> read_magicavoxel(const std::string& path, Context& ctx);

}  // namespace voxkit
