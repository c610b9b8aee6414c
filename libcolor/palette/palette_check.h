// Verifying a part of palette encoded colours.
#pragma once

#include <string>

#include "libcolor/palette/palette_layout.h"

namespace voxkit::color {

/// What in a part is not as FORMAT.md says, in words; empty if nothing is. `palette_colors`: of the scene's.
std::string check_palette_part(const PaletteView& view, uint32_t palette_colors);

}  // namespace voxkit::color
