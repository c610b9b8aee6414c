#include <algorithm>

#include "libcolor/dag/dag_view.h"
#include "libcolor/octree/octree.h"

namespace voxkit::color {
namespace {

/// A level of these masks, all ready.
OctreeLevel level_of(const std::vector<uint8_t>& masks) {
  std::vector<uint64_t> children_before{0};
  for (uint64_t page = 0; page < page_count(masks.size()); ++page) {
    uint64_t children = children_before.back();
    for (uint64_t i = 0; i < nodes_of_page(masks.size(), page); ++i)
      children += count_octants(masks[(page << page_nodes_log2) + i]);
    children_before.push_back(children);
  }
  OctreeLevel level(masks.size(), std::move(children_before));
  for (uint64_t page = 0; page < level.pages(); ++page) {
    std::memcpy(level.page(page), masks.data() + (page << page_nodes_log2),
                nodes_of_page(masks.size(), page));
    level.set_ready(page);
  }
  return level;
}

}  // namespace

Result<Octree> octree_of(const Dag& dag, Reservation& memory) {
  if (dag.voxels == 0) return Octree(dag.height, {});
  const DagView view = view_of(dag);
  std::vector<OctreeLevel> levels;
  std::vector<uint32_t> nodes{dag.root};  // pointers
  const auto count_memory = [&](uint64_t next) -> Status {
    if (next > ~uint32_t{0})
      return fail(ErrorCode::limit, {}, "an octree of more than 4294967295 nodes of a height");
    // The level, its masks once more, and the pointers of the next one.
    return memory.add(OctreeLevel::bytes(next) + next + next * sizeof(uint32_t), "an octree");
  };
  VOX_CHECK(count_memory(1));
  for (int h = dag.height; h > leaf_height; --h) {
    std::vector<uint8_t> masks;
    masks.reserve(nodes.size());
    uint64_t next_count = 0;
    for (const uint32_t pointer : nodes) {
      masks.push_back(static_cast<uint8_t>(view.node(h, pointer).mask));
      next_count += count_octants(masks.back());
    }
    VOX_CHECK(count_memory(next_count));
    std::vector<uint32_t> next;
    next.reserve(next_count);
    for (const uint32_t pointer : nodes) {
      const NodeRef node = view.node(h, pointer);
      for (uint32_t octant = 0; octant < 8; ++octant)
        if (node.has(octant)) next.push_back(view.pointer(node, octant));
    }
    levels.push_back(level_of(masks));
    nodes = std::move(next);
    VOX_CHECK(check_interrupt());
  }
  std::vector<uint8_t> masks, below;
  uint64_t below_count = 0;
  for (const uint32_t pointer : nodes) below_count += count_octants(leaf_octants(view.leaf(pointer)));
  VOX_CHECK(count_memory(below_count));
  masks.reserve(nodes.size());
  below.reserve(below_count);
  for (const uint32_t pointer : nodes) {
    const uint64_t word = view.leaf(pointer);
    masks.push_back(static_cast<uint8_t>(leaf_octants(word)));
    for (int octant = 0; octant < 8; ++octant)
      if (const auto mask = static_cast<uint8_t>(word >> 8 * octant); mask != 0) below.push_back(mask);
  }
  levels.push_back(level_of(masks));
  levels.push_back(level_of(below));
  levels.emplace_back(0, std::vector<uint64_t>{0});
  std::ranges::reverse(levels);
  return Octree(dag.height, std::move(levels));
}

}  // namespace voxkit::color
