// How far two surfaces are from each other.
#pragma once

#include "formats/context.h"
#include "libcolor/dag/dag_view.h"

namespace voxkit::color {

/// The Hausdorff distance of two surfaces in grids of the same height: the greatest distance, in voxels, from
/// a voxel of one to the nearest voxel of the other. Exact up to `most`, 0 to most_simplify. Errors:
/// ErrorCode::internal where it is above that; ErrorCode::limit.
Result<double> hausdorff_distance(const DagView& a, const DagView& b, double most, Context& ctx);

}  // namespace voxkit::color
