// The geometry of a coloured surface as an octree without pointers: of each height the masks of its nodes, in
// Morton order. The children of a node are, in the masks below, as many as its mask has bits, behind those of
// all nodes before it. File: formats/FORMAT.md, section 4.9.
#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <vector>

#include "formats/context.h"
#include "formats/reservation.h"
#include "libcolor/dag/dag.h"

namespace voxkit::color {

/// Nodes of a page: what is coded, and decoded, at once.
inline constexpr int page_nodes_log2 = 12;
inline constexpr uint64_t page_nodes = uint64_t{1} << page_nodes_log2;

constexpr uint64_t page_count(uint64_t nodes) {
  return (nodes + page_nodes - 1) >> page_nodes_log2;
}
/// Nodes of a page, the last one of which may have fewer.
constexpr uint64_t nodes_of_page(uint64_t nodes, uint64_t page) {
  const uint64_t left = nodes - (page << page_nodes_log2);
  return left < page_nodes ? left : page_nodes;
}

/// The nodes of one height: bit o of a mask is set if there is a voxel in octant o. Of height 1 the octants
/// are voxels.
class OctreeLevel {
 public:
  /// `children_before`: of each page, and of all, the children of all nodes before it.
  OctreeLevel(uint64_t nodes, std::vector<uint64_t> children_before)
      : nodes_(nodes),
        children_before_(std::move(children_before)),
        masks_((nodes + block - 1) / block * block),
        ranks_(masks_.size() / block),
        ready_(std::make_unique<std::atomic<bool>[]>(page_count(nodes))) {}

  uint64_t nodes() const { return nodes_; }
  uint64_t pages() const { return page_count(nodes_); }
  uint64_t children() const { return children_before_.back(); }
  uint64_t children_of_page(uint64_t page) const {
    return children_before_[page + 1] - children_before_[page];
  }
  /// Bytes in memory of a level of so many nodes.
  static uint64_t bytes(uint64_t nodes) { return nodes + nodes / 8 + 9 * page_count(nodes) + 64; }

  bool ready(uint64_t page) const { return ready_[page].load(std::memory_order_acquire); }
  /// The masks of a page, to be written before it is ready.
  uint8_t* page(uint64_t page) { return masks_.data() + (page << page_nodes_log2); }
  /// Counts the children of a page whose masks are there; they are as many as `children_before` says.
  void set_ready(uint64_t page) {
    uint32_t children = 0;
    const uint64_t begin = page << page_nodes_log2, end = begin + nodes_of_page(nodes_, page);
    for (uint64_t at = begin; at < end; at += block) {
      ranks_[at / block] = static_cast<uint16_t>(children);
      children += count_bits(at, block);
    }
    ready_[page].store(true, std::memory_order_release);
  }

  // Of nodes whose page is ready:
  uint8_t mask(uint64_t node) const { return masks_[node]; }
  /// The number of its first child among the nodes below; of height 1, among all voxels.
  uint64_t first_child(uint64_t node) const {
    return children_before_[node >> page_nodes_log2] + ranks_[node / block] +
           count_bits(node & ~(block - 1), node & (block - 1));
  }
  /// The page that has the parent of a node of the height below.
  uint64_t page_with_child(uint64_t child) const {
    const auto behind = std::upper_bound(children_before_.begin(), children_before_.end(), child);
    return static_cast<uint64_t>(behind - children_before_.begin()) - 1;
  }

 private:
  static constexpr uint64_t block = 16;  ///< nodes that have a rank in common

  /// Bits of the first `nodes` masks from a multiple of `block` on.
  uint32_t count_bits(uint64_t from, uint64_t nodes) const {
    uint64_t words[2];
    std::memcpy(words, masks_.data() + from, sizeof words);
    const auto count = [](uint64_t word, uint64_t bytes) {
      return std::popcount(bytes >= 8 ? word : word & ((uint64_t{1} << 8 * bytes) - 1));
    };
    return static_cast<uint32_t>(count(words[0], nodes) + (nodes > 8 ? count(words[1], nodes - 8) : 0));
  }

  uint64_t nodes_;
  std::vector<uint64_t> children_before_;
  std::vector<uint8_t> masks_;
  std::vector<uint16_t> ranks_;  ///< by block: children of the page's nodes before it
  std::unique_ptr<std::atomic<bool>[]> ready_;
};

/// An octree of which pages are there, or come when they are asked for.
class Octree {
 public:
  /// Makes a page ready, from any thread, with whatever others it needs; of a page that is damaged all masks
  /// are zero.
  using Load = std::function<void(int height, uint64_t page)>;

  /// `levels`: by height, the first one is not looked at; none where there are no voxels. No `load`: all
  /// pages are ready.
  Octree(int height, std::vector<OctreeLevel> levels, Load load = {})
      : height_(height), levels_(std::move(levels)), load_(std::move(load)) {}

  int height() const { return height_; }
  bool empty() const { return levels_.empty(); }
  OctreeLevel& level(int h) { return levels_[static_cast<size_t>(h)]; }
  const OctreeLevel& level(int h) const { return levels_[static_cast<size_t>(h)]; }
  /// A level with the page of a node ready.
  const OctreeLevel& level_at(int h, uint64_t node) const {
    const OctreeLevel& level = levels_[static_cast<size_t>(h)];
    if (!level.ready(node >> page_nodes_log2)) load_(h, node >> page_nodes_log2);
    return level;
  }

 private:
  int height_;
  std::vector<OctreeLevel> levels_;
  Load load_;
};

/// The octree of a DAG, all of it ready. Memory: a byte a node and an eighth, counted against `memory`.
/// Errors: ErrorCode::limit, also for 2^32 nodes of a height and more.
Result<Octree> octree_of(const Dag& dag, Reservation& memory);

}  // namespace voxkit::color
