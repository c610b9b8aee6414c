// How far a compressed surface is from the one that it was made of.
#pragma once

#include "libcolor/color.h"

namespace voxkit::color {

struct SurfaceDiff {
  uint64_t voxels = 0;       ///< of the source
  bool same_voxels = true;   ///< neither has a voxel that the other one has not
  double rmse = 0;           ///< root mean square of the errors of all channels, 0 to 255
  double psnr_db = 0;        ///< of peak 255
  double max_abs_error = 0;  ///< of a channel
  double max_distance = 0;   ///< greatest distance, in RGB or where the threshold is
};

/// Reads `source` and looks every voxel up in `volume`, which has the same extents.
Result<SurfaceDiff> compare(SurfaceSource& source, const Volume& volume, Context& ctx);

}  // namespace voxkit::color
