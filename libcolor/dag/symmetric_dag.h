// A DAG in which mirror images are stored once: symmetric_node.h says what its nodes are.
#pragma once

#include <vector>

#include "formats/context.h"
#include "libcolor/dag/dag_view.h"

namespace voxkit::color {

struct SymmetricDag {
  int height = leaf_height;
  Colors colors = Colors::leaf;
  Curve curve = Curve::morton;
  std::vector<uint64_t> leaves;             ///< the most used ones first
  std::vector<std::vector<uint8_t>> nodes;  ///< by height, the most used ones first; none below 3
  uint32_t root = 0;                        ///< a pointer
  uint64_t node_count = 0;                  ///< words not counted
};

/// Of a DAG with counts in nodes. Memory: its own bytes, and some 16 to 60 bytes a node of the DAG while it
/// is made, which count against ctx.memory. Errors: ErrorCode::limit, also for nodes of a height that take
/// more than 512 MiB, or 256 MiB above leaf words.
Result<SymmetricDag> symmetric_dag_of(const Dag& dag, Context& ctx);

/// A view of it.
DagView view_of(const SymmetricDag& dag);

}  // namespace voxkit::color
