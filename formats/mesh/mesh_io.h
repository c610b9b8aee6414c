// The files that assimp opens, as part of the mesh module: mapped, counted against the memory limit, found in
// spite of the spelling of other systems, and noted where they are missing.
#pragma once

#include <assimp/IOSystem.hpp>
#include <string>
#include <vector>

#include "formats/context.h"
#include "formats/reservation.h"

namespace voxkit {

/// What came of the files; it outlives the importer.
struct MeshFiles {
  explicit MeshFiles(Context& context) : ctx(context) {}
  Context& ctx;
  std::vector<std::string> opened, missing;  ///< as they are spelt in the mesh
  std::vector<Reservation> memory;           ///< what the importer makes of each
  Status status;                             ///< the first error that is not of a missing file
};

/// For the mesh `path`. The importer takes it and destroys it.
Assimp::IOSystem* mesh_io(const std::string& path, MeshFiles& files);

}  // namespace voxkit
