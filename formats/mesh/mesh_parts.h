// A mesh as its file has it, and the way from there to a Mesh.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "formats/mesh/mesh.h"
#include "formats/mesh/mesh_folder.h"

namespace voxkit {

/// A picture that a mesh uses: a file, or bytes in the mesh's own files.
struct PictureReference {
  std::string name;                   ///< as the mesh has it; for errors where it is embedded
  std::string library;                ///< the file of materials that has the name; empty: the mesh itself
  std::span<const std::byte> bytes;   ///< of an embedded picture; empty for a file of its own
  std::shared_ptr<const void> owner;  ///< of these
  /// A stored value v becomes base + gain * v, 0..1 (-mm of .mtl files).
  float base = 0, gain = 1;
  /// Of an opacity map: which channel it is: r, g, b, m (alpha), l (brightness); 0: alpha where there is one,
  /// else brightness.
  char channel = 0;
  bool used() const { return !name.empty() || !bytes.empty(); }
};

/// What a reader of mesh files finds. `mesh.materials` have no pictures yet.
struct MeshParts {
  Mesh mesh;
  struct Maps {
    PictureReference color, opacity, emission, rm;
    bool alpha_from_picture = false;  ///< a mask where the picture has alpha, as in .obj files
  };
  std::vector<Maps> maps;  ///< one a material
};

/// Checks that indices are in range and positions and picture coordinates finite where triangles use them,
/// brings colours into 0..1, makes normals that are not finite 0, and drops triangles without area, and
/// points that are nowhere. Errors: ErrorCode::input.
Status check_mesh(Mesh& mesh, const std::string& path);

/// Reads the pictures of the materials that triangles and points use; each once. `path` is the mesh's, for
/// errors.
Status load_pictures(MeshParts& parts, const std::string& path, MeshFolder& folder, Context& ctx);

}  // namespace voxkit
