// OME-XML in a TIFF file.
#pragma once

#include "formats/volume/stack_description.h"

namespace voxkit {

/// Whether a description is OME-XML.
bool is_ome(std::string_view text);

/// `describe_stack` of OME-XML.
Result<StackDescription> describe_ome(const std::string& file, std::string_view text,
                                      std::span<const int64_t> directories, int64_t samples,
                                      const OpenOptions& options);

}  // namespace voxkit
