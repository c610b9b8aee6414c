// A surface with some of the attributes that it has.
#pragma once

#include <memory>

#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// `source` without attributes that are not in `set`, which has none but its own.
std::unique_ptr<SurfaceSource> with_attributes(std::unique_ptr<SurfaceSource> source, AttributeSet set);

}  // namespace voxkit::color
