// Which parts of a cell hold voxels, two levels below it: what it looks like from afar.
#pragma once

#include "libcolor/dag/dag_view.h"

namespace voxkit::color {

/// The 4^3 parts of the node of height h, or of the leaf word, that a pointer leads to: bit i is the part
/// with the Morton code i. Void where a node is missing.
VOX_HD inline uint64_t node_parts(const DagView& view, int h, uint32_t pointer) {
  if (h == leaf_height) return view.leaf(pointer);
  const NodeRef node = view.node(h, pointer);
  uint64_t parts = 0;
  for (uint32_t octant = 0; octant < 8; ++octant) {
    if (!node.there || !node.has(octant)) continue;
    const uint32_t child = view.pointer(node, octant);
    const uint32_t octants =
        h - 1 == leaf_height ? leaf_octants(view.leaf(child)) : view.node(h - 1, child).mask;
    parts |= static_cast<uint64_t>(octants) << 8 * octant;
  }
  return parts;
}

}  // namespace voxkit::color
