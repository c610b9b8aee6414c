// Meshes in 3DS files, by our own reader.
#pragma once

#include <string>

#include "formats/mesh/mesh_parts.h"

namespace voxkit {

/// Reads a .3ds file (Autodesk, "3D Studio File Toolkit", 1994): the triangles of all objects, with the
/// diffuse colours, opacities and textures of their materials. An object that nodes of the key framer show is
/// where the first keys of each and of its parents put it; its vertices are brought there from where they are
/// stored through the object's own axes and the node's pivot; any other object is where it is stored. Colours
/// are sRGB unless only a linear one is there. A texture takes the place of the colour, where both are.
/// Errors: ErrorCode::input with the byte, ErrorCode::limit.
Result<MeshParts> read_3ds(const std::string& path, Context& ctx);

}  // namespace voxkit
