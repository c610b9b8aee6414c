// Triangles in STL files, by our own reader.
#pragma once

#include <string>

#include "formats/mesh/mesh_parts.h"

namespace voxkit {

/// Reads an .stl file (3D Systems, "StereoLithography Interface Specification", 1988), ASCII or binary:
/// binary where it is as long as its count of triangles says, whatever it begins with. Colours of binary
/// files are sRGB of 15 bits in the two bytes behind each triangle: as Materialise Magics has them where the
/// header says COLOR=, whose colour is that of triangles without their own, and else as VisCAM and SolidView
/// do; triangles without a colour are white. Colours that a header with COLOR= would hide altogether are
/// taken, with a note. Errors: ErrorCode::input, ErrorCode::limit.
Result<MeshParts> read_stl(const std::string& path, Context& ctx);

}  // namespace voxkit
