// The nodes of a DAG that grows from below: equal ones are stored once.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "formats/context.h"
#include "formats/reservation.h"
#include "libcolor/dag/dag.h"

namespace voxkit::color {

/// Equal runs of words are stored once: open addressing, whole runs compared.
template <class Word>
class UniqueRuns {
 public:
  /// The place in `pool` of a run of these words, which is added unless it is there. `words` words are
  /// compared with what follows a place; runs tell their own length.
  uint32_t add(std::vector<Word>& pool, std::span<const Word> words);
  uint64_t size() const { return used_; }
  uint64_t bytes() const { return slots_.capacity() * sizeof(Slot); }

 private:
  struct Slot {
    uint32_t place = 0;
    uint32_t tag = 0;  ///< of the hash, never 0 where there is a run
  };
  void grow(size_t slots);
  std::vector<Slot> slots_;
  uint64_t used_ = 0;
};

/// A node or a leaf word, and how many colours it has.
struct Subtree {
  uint32_t pointer = 0;
  uint64_t colors = 0;
};

/// What a node is made of: its octants' subtrees, in order of their Morton numbers.
struct Octants {
  uint32_t mask = 0;
  uint32_t count = 0;
  std::array<Subtree, 8> subtrees;

  void add(uint32_t octant, Subtree subtree) {
    mask |= 1u << octant;
    subtrees[count++] = subtree;
  }
};

/// Memory: the DAG and its hash tables, which count against ctx.memory.
class DagPool {
 public:
  /// A grid of 2^height voxels a side, 2 <= height <= 21.
  DagPool(int height, Colors colors, Counts counts, Curve curve, Context& ctx);
  /// A word with at least one voxel. ErrorCode::limit if there are too many.
  Result<Subtree> add_leaf(uint64_t leaf);
  /// A node above leaf_height. `state`: how it is gone through, which tells with Counts::pointer what is
  /// before an octant. ErrorCode::limit if there are too many, or colours for Counts::pointer.
  Result<Subtree> add_node(int height, const Octants& octants, OrderState state);
  /// Counts what has grown since.
  Status check_memory();
  /// The DAG, of so many voxels; call it last. Its root is a node, or a word, of its height, or empty.
  Dag finish(Subtree root, uint64_t voxels);

 private:
  Dag dag_;
  UniqueRuns<uint64_t> unique_leaves_;
  std::vector<UniqueRuns<uint32_t>> unique_nodes_;  ///< by height
  Reservation reservation_;
  uint64_t reserved_ = 0;
};

}  // namespace voxkit::color
