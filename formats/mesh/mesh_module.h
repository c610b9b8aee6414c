// What a module offers that reads meshes: mesh.so.
#pragma once

#include "formats/mesh/mesh_parts.h"
#include "formats/module.h"

namespace voxkit {

struct MeshModule {
  /// Not yet checked and without textures.
  Result<MeshParts> (*read)(const std::string& path, Context& ctx) = nullptr;
};

}  // namespace voxkit
