// Volumes in TIFF files: many pages of one, or a file a slice.
#pragma once

#include <string>
#include <vector>

#include "formats/volume/readers.h"

namespace voxkit {

/// Opens the pages of one file (`pages`), or the only page of each of several. Part of the module of image
/// stacks. Errors: those of open_volume.
SourceResult open_tiff_stack(std::vector<std::string> files, bool pages, const OpenOptions& options,
                             Context& ctx);

}  // namespace voxkit
