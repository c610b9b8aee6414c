// The files that a mesh names: textures, buffers, libraries of materials.
#pragma once

#include <set>
#include <string>

#include "formats/result.h"

namespace voxkit {

/// Finds the files that a mesh names, in its folder and the folders in that; elsewhere only with leave. Only
/// regular files are found, also by links.
class MeshFolder {
 public:
  /// Of the mesh at `path`; `allow_outside`: names may lead out of its folder.
  MeshFolder(const std::string& path, bool allow_outside);

  /// The file that the mesh calls `name`, or a file `by` that was found for it does, beside that: as it is
  /// written, with '/' for '\', and with its %-escapes
  /// resolved; then in letters of either case; then by its last part, beside that file and beside the mesh.
  /// Empty where there is none. Errors: ErrorCode::input where the name leads out of the folder without
  /// leave, and nothing beside the mesh has its last part, or where it is that of something else than a file;
  /// `what` the file is to be, for the message.
  Result<std::string> find(const std::string& name, const std::string& what, const std::string& by = {});

  /// A sentence about files that are not where the mesh names them, and were taken from beside it; empty
  /// where all are.
  std::string note() const;

 private:
  std::string path_, folder_;
  bool allow_outside_;
  std::set<std::string> moved_;  ///< names of what was taken from beside the mesh
};

}  // namespace voxkit
