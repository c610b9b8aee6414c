// What compressed surfaces have beside colours, of what was hit.
#pragma once

#include "formats/context.h"
#include "libcolor/color.h"
#include "librender/cast/ray_cast.h"

namespace voxkit::render {

/// Those of a file that CastOptions::traits asks for.
color::AttributeSet traits_of(const color::Volume& volume, color::AttributeSet wanted);

/// Gives a picture by a view of `volume`, with details, the traits of what its rays hit first: those of
/// `wanted` that there are. `glimpses`: those of a picture with levels of detail, else null: traits are those
/// of the cell that the ray came to. ErrorCode::input where attributes are damaged; ErrorCode::limit.
Status look_up_traits(const color::Volume& volume, color::AttributeSet wanted, const Glimpse* glimpses,
                      Frame& frame, Context& ctx);

}  // namespace voxkit::render
