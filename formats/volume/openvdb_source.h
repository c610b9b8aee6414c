// Grids of OpenVDB files as volumes. Part of the module openvdb.
#pragma once

#include <string>

#include "formats/volume/readers.h"

namespace voxkit {

/// `open_vdb` of readers.h.
SourceResult open_vdb_grid(const std::string& path, const OpenOptions& options, Context& ctx);

}  // namespace voxkit
