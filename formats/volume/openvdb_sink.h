// Volumes as OpenVDB grids. Part of the module openvdb.
#pragma once

#include <string>

#include "formats/volume/readers.h"

namespace voxkit {

/// `create_vdb` and `create_vdb_voxels` of readers.h.
SinkResult create_vdb_sink(const std::string& path, const VolumeInfo& info, bool force, Context& ctx);
VoxelSinkResult create_vdb_voxel_sink(const std::string& path, const VolumeInfo& info, bool force,
                                      Context& ctx);

}  // namespace voxkit
