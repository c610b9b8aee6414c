// The faces of a surface's voxels toward void, as rectangles of one colour.
#pragma once

#include <functional>
#include <span>

#include "formats/context.h"
#include "formats/mesh/voxel_faces.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// Gives the voxels of a box, each once, in any order; the same ones whenever it is asked.
using VoxelsOfBox = std::function<Status(const Box& box, const SurfaceSource::Sink& sink)>;

/// Where faces go, in runs.
struct FaceSink {
  std::function<Status(std::span<const FaceRectangle>)> faces;
  std::function<Status(std::span<const ModelVoxel>)> enclosed;  ///< voxels with voxels on all six sides
};

/// All faces between a voxel of `box` and void, or what is outside of the box, each in one rectangle: so
/// these close the voxels from all sides. They are merged greedily (greedy_rectangles.h) in each layer, along
/// x, then y, then z. Places count from the box's lower corner. Rectangles meet at borders of voxels only; a
/// corner of one may lie on the middle of another's side.
///
/// Reads the box once to count, and once for each axis, or in slabs where less than all fits into a quarter
/// of ctx.memory. Memory: 12 bytes a voxel of a slab, of three layers at least, and 24 for each layer of the
/// box. What comes does not depend on memory or ctx.threads. Errors: those of `voxels` and of the sinks;
/// ErrorCode::limit.
Status surface_faces(const Box& box, const VoxelsOfBox& voxels, const FaceSink& sink, Context& ctx);

}  // namespace voxkit::color
