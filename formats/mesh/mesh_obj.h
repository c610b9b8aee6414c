// Meshes in Wavefront files: .obj, and .mtl beside them, by our own reader.
#pragma once

#include <map>
#include <set>
#include <string>

#include "formats/mesh/mesh_parts.h"

namespace voxkit {

/// Reads an .obj file (Wavefront, "Object Files", 1995): polygons of v with vt, and points; colours behind
/// the coordinates of a vertex are sRGB. Groups and smoothing do not matter, nor do normals (vn)
/// where they are not wanted; lines, curves and
/// surfaces are dropped, with a note. Lines of text may go on behind a backslash; numbers of vertices may
/// lead to later ones. Libraries of materials are looked for in `folder`. Errors: ErrorCode::input with the
/// line, ErrorCode::limit.
Result<MeshParts> read_obj(const std::string& path, MeshFolder& folder, Context& ctx,
                           const MeshOptions& options = {});

/// Picture coordinates, which count from the bottom here, become scale * uv + offset (-s and -o).
struct MapTransform {
  glm::dvec2 scale{1, 1}, offset{0, 0};
  friend bool operator==(const MapTransform&, const MapTransform&) = default;
};

/// A material of a .mtl file.
struct ObjMaterial {
  MeshMaterial material;
  MeshParts::Maps maps;
  MapTransform color, emission;
};

/// The materials of .mtl files by their names.
struct MaterialLibrary {
  std::map<std::string, ObjMaterial> materials;
  std::set<std::string> dropped;  ///< what of them a Mesh cannot say
  bool rm = false;                ///< roughness and metalness, Pr and Pm, are wanted
};

/// Adds the materials of a .mtl file (Wavefront, "MTL material format", 1995): Kd, map_Kd, Ke, map_Ke, d, Tr,
/// map_d, and Pr and Pm where they are wanted, with the options -s, -o, -mm, -clamp and -imfchan of maps.
/// Colours are sRGB. Where there is both d and Tr, d counts. Errors: ErrorCode::input with the line.
Status read_mtl(const std::string& path, MaterialLibrary& library);

}  // namespace voxkit
