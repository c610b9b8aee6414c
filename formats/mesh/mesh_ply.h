// Meshes in PLY files, by our own reader: assimp's trusts what they say.
#pragma once

#include <string>

#include "formats/mesh/mesh_parts.h"

namespace voxkit {

/// Reads a .ply file (Greg Turk, "The PLY polygon file format", 1994): ASCII and binary of either byte order.
/// Vertices have x, y, z; colours as red, green, blue and alpha, as r, g, b and a, or as diffuse_red and so
/// on; s and t, u and v or picture_u and picture_v, which count from the bottom. Faces have vertex_indices or
/// vertex_index, colours of their own where vertices have none, and, as MeshLab writes them, a list texcoord
/// of two numbers a corner and a texnumber; `comment PictureFile` names the pictures. tristrips are strips of
/// triangles, which -1 ends. Other elements and properties are passed over, with a note. Errors:
/// ErrorCode::input, ErrorCode::limit.
Result<MeshParts> read_ply(const std::string& path, Context& ctx, const MeshOptions& options = {});

}  // namespace voxkit
