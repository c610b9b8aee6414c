// What is behind the voxels of a compressed surface that let something through.
#pragma once

#include <vector>

#include "librender/cast/cast_params.h"
#include "librender/cast/ray_cast.h"

namespace voxkit::render {

/// Of a picture by a view of a file with opacities, with details and colours: follows anew, voxel by voxel
/// and front to back, each ray that met something translucent first. `params` are those of all detail;
/// `glimpses` those of the picture, or null: such a pixel has none any more. Returns for each pixel whether
/// it was one of these. Counts of `frame` grow. ErrorCode::limit; ErrorCode::input where the file is damaged.
Result<std::vector<uint8_t>> see_through(const color::Volume& volume, const color::DagView& dag,
                                         const CastParams& params, Glimpse* glimpses, Frame& frame,
                                         Context& ctx);

/// Gives those pixels, whose traits are known, the light of all that their rays came through.
Status shine_through(const color::Volume& volume, const color::DagView& dag, const CastParams& params,
                     const std::vector<uint8_t>& pixels, Frame& frame, Context& ctx);

}  // namespace voxkit::render
