// How far a compressed surface is from the one that it was made of.
#pragma once

#include <vector>

#include "libcolor/color.h"

namespace voxkit::color {

/// How far an attribute is from what it was made of, in its space; of ids: whether any differs.
struct AttributeDiff {
  Attribute attribute = Attribute::emissive;
  double most_error = 0;
  uint64_t differing = 0;  ///< voxels
};

struct SurfaceDiff {
  uint64_t voxels = 0;                    ///< of the source
  bool same_voxels = true;                ///< neither has a voxel that the other one has not
  double rmse = 0;                        ///< root mean square of the errors of all channels, 0 to 255
  double psnr_db = 0;                     ///< of peak 255
  double max_abs_error = 0;               ///< of a channel
  double max_distance = 0;                ///< greatest distance, in RGB or where the threshold is
  bool same_attributes = true;            ///< neither has one that the other one has not
  std::vector<AttributeDiff> attributes;  ///< those that both have
};

/// Reads `source` and looks every voxel up in `volume`, which has the same extents.
Result<SurfaceDiff> compare(SurfaceSource& source, const Volume& volume, Context& ctx);

}  // namespace voxkit::color
