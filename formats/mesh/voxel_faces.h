// Voxels as the faces that are seen of them: what becomes a mesh file.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "formats/context.h"
#include "formats/volume.h"
#include "formats/voxel_sink.h"

namespace voxkit {

/// A rectangle of voxel faces that look to one side, all of one colour, R, G and B in sRGB. Places count
/// edges of voxels from the volume's corner. Behind the plane are the voxels, and before it is void.
struct FaceRectangle {
  std::array<uint8_t, 3> color{};
  uint8_t axis = 0;                   ///< along which it looks
  bool positive = false;              ///< forwards, else backwards
  int32_t plane = 0;                  ///< its place on that axis
  std::array<int32_t, 2> lo{}, hi{};  ///< its extent along the axes (axis + 1) % 3 and (axis + 2) % 3
};

/// The four corners in voxel edges, so that they turn counterclockwise for who looks at the face, where the
/// axes are right-handed.
std::array<std::array<int32_t, 3>, 4> corners_of(const FaceRectangle& face);

/// Takes the faces of a volume, and writes them as a mesh.
class FaceWriter {
 public:
  virtual ~FaceWriter() = default;
  /// Takes rectangles of which no two share a face, in any order.
  virtual Status add(std::span<const FaceRectangle> faces) = 0;
  /// Takes voxels that have no face, since there are voxels on all of their six sides: they become points at
  /// their centres.
  virtual Status add_enclosed(std::span<const ModelVoxel> voxels) = 0;
  /// Completes the files; without it, none appears.
  virtual Status finish() = 0;
};

/// Whether a name is that of a mesh that voxels can be written as: .glb or .obj.
bool is_face_output(const std::string& name);
/// The files of that name: of x.obj also x.mtl and x.png.
std::vector<std::string> files_of_faces(const std::string& name);

/// Starts a mesh of the voxels of a volume, of which `info` gives extents and place: triangles, or in .obj
/// files polygons of four corners, in the volume's world, and one texture, of NEAREST texels, one for each
/// colour, so that colours are exact and need no more than this one file (.glb), or these three (.obj, .mtl,
/// .png). Each rectangle has corners of its own; in .obj files those in one plane share them as long as there
/// are not too many. The volume's grid is written into the file (voxel_grid.h). Memory: 30 MiB, and 22 bytes
/// a texel of the texture; rectangles go through a file in $TMPDIR, 28 bytes each, and enclosed voxels, 16.
/// What the file cannot hold is said (ctx.note).
///
/// Errors: ErrorCode::usage for a name that is none, or that a line of text cannot hold, or where there is no
/// library for PNG; ErrorCode::output; ErrorCode::limit where a .glb file would be larger than 4 GiB.
Result<std::unique_ptr<FaceWriter>> create_faces(const std::string& path, const VolumeInfo& info, bool force,
                                                 Context& ctx);

}  // namespace voxkit
