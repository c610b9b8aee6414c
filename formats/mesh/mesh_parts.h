// A mesh as its file has it, and the way from there to a Mesh.
#pragma once

#include <string>
#include <vector>

#include "formats/mesh/mesh.h"

namespace voxkit {

/// A texture that a mesh uses: a file, or bytes in the mesh's own file.
struct TextureReference {
  std::string name;              ///< as the mesh has it; for errors where it is embedded
  std::vector<std::byte> bytes;  ///< of an embedded PNG or JPEG file; empty for a file of its own
  bool used() const { return !name.empty() || !bytes.empty(); }
};

/// What a reader of mesh files finds. `mesh.materials` have no textures yet.
struct MeshParts {
  Mesh mesh;
  struct Maps {
    TextureReference color, opacity;
    bool alpha_from_texture = false;  ///< a mask where the texture has alpha, as in .obj files
  };
  std::vector<Maps> maps;  ///< one a material
};

/// Checks that indices are in range and positions and texture coordinates finite where triangles use them,
/// brings colours into 0..1, and drops triangles without area. Errors: ErrorCode::input.
Status check_mesh(Mesh& mesh, const std::string& path);

/// Reads the textures of the materials that triangles use; each file once.
Status load_textures(MeshParts& parts, const std::string& path, Context& ctx);

}  // namespace voxkit
