// Faces on their way to a file that says how many there are before it has them.
#pragma once

#include <functional>
#include <vector>

#include "formats/mapped_file.h"
#include "formats/mesh/face_palette.h"
#include "formats/mesh/voxel_faces.h"

namespace voxkit {

/// Keeps rectangles and enclosed voxels in the order in which they come, in unlinked files in $TMPDIR, and
/// counts them and their colours.
class FaceSpool {
 public:
  Status add(std::span<const FaceRectangle> faces);
  Status add_enclosed(std::span<const ModelVoxel> voxels);
  uint64_t faces() const { return faces_; }
  uint64_t enclosed() const { return enclosed_; }
  /// Of all that was added; arranged by `close`.
  const FacePalette& palette() const { return palette_; }
  /// Nothing more comes.
  Status close();
  /// All of them, in runs. After `close`; any number of times.
  Status each_face(const std::function<Status(std::span<const FaceRectangle>)>& take) const;
  Status each_enclosed(const std::function<Status(std::span<const ModelVoxel>)>& take) const;

 private:
  TemporaryFile face_file_{"the faces of a mesh"}, enclosed_file_{"the faces of a mesh"};
  std::shared_ptr<const MappedFile> face_bytes_, enclosed_bytes_;
  uint64_t faces_ = 0, enclosed_ = 0;
  FacePalette palette_;
};

}  // namespace voxkit
