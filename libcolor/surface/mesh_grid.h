// The grid of a mesh's voxels, and its corners on it.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <optional>

#include "formats/mesh/mesh.h"
#include "libcolor/surface/triangle_cells.h"

namespace voxkit::color {

/// Where the voxels are into which a mesh is cut, and corners in steps of 2^-8 voxel on it
/// (triangle_cells.h).
class MeshGrid {
 public:
  /// Around the mesh, so many voxels along its longest side.
  static MeshGrid around(const Mesh& mesh, int64_t resolution);
  /// The one that the mesh says it is of (Mesh::grid); nothing where it says none, or is not inside it.
  ///
  /// Triangles in a plane between two layers of its voxels are faces of those behind them, whose front is
  /// where corners turn counterclockwise. They are snapped into these, and inwards at their own borders,
  /// which are between voxels, too: so they are in these voxels, and no other. All other triangles are taken
  /// as they are.
  static std::optional<MeshGrid> own(const Mesh& mesh);

  /// Extents, place, world.
  const VolumeInfo& info() const { return info_; }
  /// What takes normals to the axes of voxels, but for their length.
  glm::dmat3 normal_axes() const { return glm::transpose(glm::inverse(scale_)); }
  /// A triangle whose corners are vertices of the mesh; all three may be one.
  SnappedTriangle snap(const Mesh& mesh, const MeshTriangle& triangle) const;

 private:
  glm::dvec3 steps_of(const glm::dvec3& p) const { return scale_ * (p - lo_); }
  int32_t place(double steps, size_t axis) const;
  SnappedTriangle snap_faces(const std::array<glm::dvec3, 3>& steps) const;

  VolumeInfo info_;
  glm::dvec3 lo_{0};
  glm::dmat3 scale_{1};  ///< a corner p is at scale_ * (p - lo_) steps
  bool own_ = false, mirrored_ = false;
};

}  // namespace voxkit::color
