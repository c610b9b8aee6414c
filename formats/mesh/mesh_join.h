// Several meshes in one.
#pragma once

#include <vector>

#include "formats/context.h"
#include "formats/mesh/mesh.h"
#include "formats/mesh/point_cloud.h"

namespace voxkit {

/// Moves a mesh, and its grid of voxels, if it has one.
void move_mesh(Mesh& mesh, const glm::dvec3& by);

/// Places, colours and opacities of points as a mesh that has only such, to be joined with others: 48 bytes
/// each, which count against ctx.memory. Errors: ErrorCode::limit; those of reading them.
Result<Mesh> mesh_of_points(const PointCloud& points, Context& ctx);

/// Meshes that lie in one world, one after the other: so are the numbers of their materials. Grids of voxels
/// are dropped, as one goes around all of them; notes stay. Errors: ErrorCode::limit, also for 2^32 vertices,
/// or materials, or more.
Result<Mesh> join_meshes(std::vector<Mesh> meshes, Context& ctx);

}  // namespace voxkit
