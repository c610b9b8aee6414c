// Meshes in glTF 2.0 files, by our own reader.
#pragma once

#include <string>

#include "formats/mesh/mesh_parts.h"

namespace voxkit {

/// Reads a .gltf or .glb file: the meshes of its scene where its nodes put them, with their morph weights and
/// their skins as the nodes have them, which is at rest. Triangles and points are read, lines are dropped.
/// The extensions that gltf_document.cc names are understood. Buffers are looked for in `folder`.
/// Errors: ErrorCode::input, ErrorCode::limit.
Result<MeshParts> read_gltf(const std::string& path, MeshFolder& folder, Context& ctx,
                            const MeshOptions& options = {});

}  // namespace voxkit
