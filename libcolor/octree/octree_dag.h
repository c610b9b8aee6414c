// The DAG of an octree in a file.
#pragma once

#include "formats/context.h"
#include "libcolor/dag/dag.h"
#include "libcolor/octree/octree_reader.h"

namespace voxkit::color {

/// Decodes all pages, on ctx.threads threads; equal subtrees are found again. Memory: the DAG and its hash
/// tables, which count against ctx.memory while it is made. Errors: damage, ErrorCode::limit.
Result<Dag> dag_of(OctreeReader& octree, Colors colors, Counts counts, Curve curve, const Context& ctx);

}  // namespace voxkit::color
