// Volumes in PNG files, one a slice.
#pragma once

#include <string>
#include <vector>

#include "formats/volume/readers.h"

namespace voxkit {

/// Part of the module of image stacks. Errors: those of open_volume.
SourceResult open_png_stack(std::vector<std::string> files, const OpenOptions& options, Context& ctx);

}  // namespace voxkit
