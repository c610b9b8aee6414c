// The same voxels with other counts: of colours of all nodes, beside pointers, along another curve.
#pragma once

#include "formats/context.h"
#include "libcolor/dag/dag.h"

namespace voxkit::color {

/// A DAG from DagBuilder, with the counts that are asked for. Counts in nodes do not depend on the curve;
/// with counts beside pointers, equal subtrees that the curve goes through in different ways are stored once
/// for each. Memory: the new DAG, its hash tables, and 16 to 192 bytes a word of the nodes of the old one.
/// Errors: those of DagPool.
Result<Dag> recount(const Dag& dag, Colors colors, Counts counts, Curve curve, Context& ctx);

}  // namespace voxkit::color
