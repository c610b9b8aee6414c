// Volumes as numbered images by OpenImageIO, one a slice. Part of the module of image stacks.
#pragma once

#include <string>

#include "formats/volume/readers.h"

namespace voxkit {

/// `create_image_stack` of readers.h.
SinkResult create_image_stack_sink(const std::string& pattern, const VolumeInfo& info, bool force,
                                   Context& ctx);

}  // namespace voxkit
