// Ambient occlusion in screen space, by horizons (Bavoil, Sainz, Dimitrov 2008).
#pragma once

#include "formats/image/image.h"
#include "librender/surface.h"

namespace voxkit::render {

/// How much of the half space over each pixel is open, one float a pixel: 0..1; 1 where nothing was hit.
/// `normals`: as find_normals returns them. Does not depend on ctx.threads.
Result<Image> find_openness(const Surface& surface, const Image& normals, Context& ctx);

}  // namespace voxkit::render
