// An octree in a file: a page is decoded when it is first asked for.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <mutex>
#include <span>

#include "formats/volume.h"
#include "libcolor/dag/dag.h"
#include "libcolor/octree/context_lookup.h"
#include "libcolor/octree/octree.h"
#include "libcolor/surface/morton.h"

namespace voxkit::color {

/// Safe on any bytes; thread-safe.
class OctreeReader {
 public:
  /// The bytes of a part of the masks, which stay.
  using PartBytes = std::function<Result<std::span<const std::byte>>(uint64_t part)>;

  /// Of a grid of 2^height voxels a side with so many voxels, in parts of these sizes; `name` is for
  /// messages. Memory: a byte a node and an eighth. Errors: ErrorCode::input for a directory that is not as
  /// FORMAT.md has it, ErrorCode::limit.
  static Result<std::unique_ptr<OctreeReader>> open(std::span<const std::byte> directory, int height,
                                                    uint64_t voxels, std::vector<uint64_t> part_sizes,
                                                    PartBytes parts, std::string name, MemoryBudget& memory);

  int height() const { return octree_->height(); }
  /// Decodes all pages, on ctx.threads threads.
  Status decode_all(const Context& ctx);
  /// The first damage that was met; what is in a damaged page is void.
  Status status() const;
  uint64_t pages_decoded() const { return pages_decoded_; }

  /// Calls visit(word, corner, first) for each cell of height 2 with voxels that touches a box, in Morton
  /// order, until it returns false: which voxels there are, as in a DAG's leaf words; where the cell begins;
  /// how many voxels come before it in Morton order. False if `visit` did.
  template <class Visit>
  bool for_each_word(const Box& box, const Visit& visit) const {
    if (octree_->empty()) return true;
    const auto enter = [&](int h, uint64_t, Index3 at) {
      return !intersect({at, at + (int64_t{1} << h)}, box).empty();
    };
    return node(octree_->height(), 0, Index3(0), enter, visit);
  }
  /// The same for the cells that have voxels whose numbers in Morton order are from `first` to `last`.
  template <class Visit>
  bool for_each_word_of(uint64_t first, uint64_t last, const Visit& visit) const {
    if (octree_->empty()) return true;
    const NodePath from = path_to(first), to = path_to(last);
    const auto enter = [&](int h, uint64_t number, Index3) {
      return number >= from[static_cast<size_t>(h)] && number <= to[static_cast<size_t>(h)];
    };
    return node(octree_->height(), 0, Index3(0), enter, visit);
  }

  /// Whether no voxel is in a box, as far as undamaged pages say.
  bool is_void(const Box& box) const {
    return for_each_word(box, [&](uint64_t word, Index3 corner, uint64_t) {
      for (; word != 0; word &= word - 1)
        if (box.contains(corner + Index3(morton_place(static_cast<uint64_t>(std::countr_zero(word))))))
          return false;
      return true;
    });
  }

 private:
  struct Page {
    uint32_t part, offset, bytes;  ///< where it begins in its part
  };
  OctreeReader() = default;
  void load(int height, uint64_t page);
  Status decode_page(int height, uint64_t page);

  /// By height: a voxel, and the nodes above it.
  using NodePath = std::array<uint64_t, most_levels + 1>;
  NodePath path_to(uint64_t voxel) const;

  /// Enters children for which enter(height, number, corner) says so.
  template <class Enter, class Visit>
  bool node(int h, uint64_t number, Index3 corner, const Enter& enter, const Visit& visit) const {
    const OctreeLevel& level = octree_->level_at(h, number);
    const uint32_t mask = level.mask(number);
    uint64_t child = level.first_child(number);
    if (h == leaf_height) return word(mask, child, corner, visit);
    const int64_t side = int64_t{1} << (h - 1);
    for (uint32_t octant = 0; octant < 8; ++octant) {
      if ((mask >> octant & 1) == 0) continue;
      const Index3 at = corner + Index3(octant & 1, octant >> 1 & 1, octant >> 2) * side;
      if (enter(h - 1, child, at) && !node(h - 1, child, at, enter, visit)) return false;
      ++child;
    }
    return true;
  }
  template <class Visit>
  bool word(uint32_t mask, uint64_t child, Index3 corner, const Visit& visit) const {
    if (mask == 0) return true;  // damaged
    const uint64_t first = octree_->level_at(1, child).first_child(child);
    uint64_t word = 0;
    for (uint32_t octant = 0; octant < 8; ++octant)
      if ((mask >> octant & 1) != 0) {
        word |= uint64_t{octree_->level_at(1, child).mask(child)} << 8 * octant;
        ++child;
      }
    return visit(word, corner, first);
  }

  std::optional<Octree> octree_;
  std::vector<ContextLookup> trees_;  ///< by height
  std::vector<Page> pages_;           ///< of all heights, the highest first
  std::vector<uint64_t> first_page_;  ///< by height
  PartBytes parts_;
  std::string name_;
  Reservation reservation_;
  std::recursive_mutex loading_;
  mutable std::mutex mutex_;
  Status status_;
  std::atomic<uint64_t> pages_decoded_{0};
};

}  // namespace voxkit::color
