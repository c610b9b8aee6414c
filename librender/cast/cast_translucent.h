// Casting compressed surfaces that let something through.
#pragma once

#include "librender/cast/cast_params.h"
#include "librender/cast/ray_cast.h"

namespace voxkit::render {

/// A picture of a file with opacities, voxel by voxel through what is translucent, front to back. Levels of
/// detail are not used. Where light is wanted (options.traits) each pixel has that of all that its ray came
/// through. Errors: those of cast.
Status cast_translucent(const color::Volume& volume, const color::DagView& dag, const CastParams& params,
                        const CastOptions& options, Frame& frame, Context& ctx);

}  // namespace voxkit::render
