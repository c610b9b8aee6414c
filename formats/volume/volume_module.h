// What a module offers that reads or writes volumes: image_stack.so, openvdb.so, dicom.so.
#pragma once

#include "formats/module.h"
#include "formats/volume/readers.h"

namespace voxkit {

struct VolumeModule {
  SourceResult (*open)(const std::string& path, const OpenOptions& options, Context& ctx) = nullptr;
  /// Null in modules that only read.
  SinkResult (*create)(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) = nullptr;
  /// Voxels with colours, one by one (openvdb only): `create_vdb_voxels` of readers.h.
  VoxelSinkResult (*create_voxels)(const std::string& path, const VolumeInfo& info, bool force,
                                   Context& ctx) = nullptr;
};

}  // namespace voxkit
