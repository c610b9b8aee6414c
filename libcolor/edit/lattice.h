// One grid for surfaces that lie in one world, each in a grid of its own.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/result.h"
#include "formats/volume.h"

namespace voxkit::color {

struct CommonGrid {
  VolumeInfo info;                 ///< the smallest one that holds all; what else it says is the first one's
  std::vector<Index3> at;          ///< where in it the first voxel of each lies
  std::vector<std::string> notes;  ///< what others say and the first one does not, a sentence each
};

/// Finds where volumes lie in one grid, by their affines: their axes must be equal, and their voxels as far
/// apart as whole numbers of steps along these, to a hundredth of a voxel everywhere. Worlds and units must
/// be the same. `names`: of their files, for messages. Errors: ErrorCode::input, with the name of the one
/// that does not fit, or where the grid has a side above 2^21 or more than 2^62 voxels.
Result<CommonGrid> common_grid(std::span<const VolumeInfo> volumes, std::span<const std::string> names);

}  // namespace voxkit::color
