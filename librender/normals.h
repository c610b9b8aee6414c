// Normals from the depth buffer (thesis section 3.4.1): a voxel has six faces only, so the surface that the
// voxels stand for has to be guessed from what is around a pixel.
#pragma once

#include "formats/image/image.h"
#include "librender/surface.h"

namespace voxkit::render {

/// Unit normals in the world, towards the viewer, three floats a pixel; 0 where nothing was hit. A flat face
/// has one normal; steps of a voxel become a slope, edges stay sharp. Does not depend on ctx.threads.
Result<Image> find_normals(const Surface& surface, Context& ctx);

}  // namespace voxkit::render
