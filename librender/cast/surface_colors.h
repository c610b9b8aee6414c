// The second pass of casting compressed surfaces: the colours of what was hit, and no others (D. Dolonius et
// al., TVCG 2019, section 5).
#pragma once

#include "formats/context.h"
#include "libcolor/color.h"
#include "librender/cast/ray_cast.h"

namespace voxkit::render {

/// Gives each pixel of a picture by DagCastView, with details, the colour of the cell that its ray hit; or,
/// unless `glimpses` is null, those of the cells that it saw. Adds its time to `frame`. ErrorCode::input
/// where colours are damaged.
Status look_up_colors(const color::Volume& volume, const Glimpse* glimpses, Frame& frame, Context& ctx);

}  // namespace voxkit::render
