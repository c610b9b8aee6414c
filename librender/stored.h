// What files say of a surface, where it need not be guessed from the picture.
#pragma once

#include "formats/image/image.h"
#include "librender/surface.h"

namespace voxkit::render {

/// The normals that a frame's traits have, as find_normals makes them: towards the viewer.
Result<Image> stored_normals(const Frame& frame, const Surface& surface, Context& ctx);

/// Colours are what a display shows, 0..1; light adds up in proportion to what it is. What is left of a
/// colour without the light that it emits, 0 at least; and a colour with that, 1 at most.
float without_light(float color, float light);
float with_light(float color, float light);

}  // namespace voxkit::render
