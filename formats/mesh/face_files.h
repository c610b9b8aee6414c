// The two kinds of mesh files that faces are written to, each behind voxel_faces.h.
#pragma once

#include "formats/mesh/face_spool.h"
#include "formats/mesh/voxel_faces.h"

namespace voxkit {

/// gltf_write.cc, obj_write.cc: `create_faces` of that ending.
Result<std::unique_ptr<FaceWriter>> create_glb_faces(const std::string& path, const VolumeInfo& info,
                                                     bool force, Context& ctx);
Result<std::unique_ptr<FaceWriter>> create_obj_faces(const std::string& path, const VolumeInfo& info,
                                                     bool force, Context& ctx);

}  // namespace voxkit
