// From a mesh to the voxels of its surface.
#pragma once

#include <memory>
#include <optional>

#include "formats/mesh/mesh.h"
#include "libcolor/surface/surface.h"
#include "libcolor/surface/triangle_cells.h"

namespace voxkit::color {

/// Voxels along the longest side where nothing else is said.
inline constexpr int64_t default_resolution = 1024;

/// How a mesh becomes voxels.
struct VoxeliseOptions {
  /// Voxels along the longest side of the mesh's box, 1 to 2^21: a voxel's edge is that side divided by it.
  /// Not said: the mesh's own grid, where it is inside one (mesh_grid.h), else default_resolution. Where it
  /// is that of its own grid, that is taken, too.
  std::optional<int64_t> resolution = {};
  SurfaceKind kind = SurfaceKind::thin;
  /// Voxels along the side of the cubes that the work is split into, as a power of two, 0 to 8. The result
  /// does not depend on it.
  int tile_bits = 6;
  bool emission = true;  ///< is added to the colours
  /// What voxels have beside colours. Not said: emissive where a material gives light, and emission is added;
  /// opacity where a blended material is not opaque.
  std::optional<AttributeSet> attributes = {};
};

/// The surface of a mesh. Its corners are snapped to a grid of 2^-8 voxel (triangle_cells.h); from there on
/// it is decided in integers which voxels there are. A thin surface has no hole for what moves from face to
/// face; a conservative one has every voxel that a triangle touches.
///
/// A point is in the voxel that it lies in.
///
/// The colour of a voxel is the mean, in linear light, over the triangles in it, each with the area that it
/// has there (and times its alpha, where that is blended): of the picture around the point of the triangle
/// that is nearest to the voxel's centre, at the size at which a voxel's edge is a texel, times the
/// material's and the corners' colours, and its emission added, up to white. A triangle whose alpha there is
/// below its material's cut-off is not in the voxel. Where all that is in it is blended and less than half
/// opaque there is no voxel: surfaces are there or not, and a note says where a mesh is something in between.
///
/// With opacity a voxel is there from 1/255 on. Its opacity is the mean over the triangles in it of how much
/// of them is there, by area; 255 where one covers all. Of a mask that is the share of the texels of a voxel
/// that are not cut off. Other attributes are means as colours are: light that is emitted, which the colour
/// has, too, up to white; normals, those of vertices between them, else that of the triangle, along the axes
/// of voxels; roughness and metalness. The id is the number of the material that has most of the voxel.
///
/// Memory: 48 bytes a triangle and 11 a texel beside the mesh, and what the threads work with, which is less
/// where ctx.memory has little. Errors: ErrorCode::usage for the resolution, and for
/// attributes that there are not, ErrorCode::limit.
Result<std::unique_ptr<SurfaceSource>> make_surface(Mesh mesh, const VoxeliseOptions& options, Context& ctx);

}  // namespace voxkit::color
