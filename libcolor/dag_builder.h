// From voxels in Morton order to a DAG, bottom up, in one pass.
#pragma once

#include <span>
#include <vector>

#include "formats/context.h"
#include "formats/reservation.h"
#include "libcolor/dag.h"
#include "libcolor/surface.h"

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

/// Memory: the DAG and its hash tables, which count against ctx.memory.
class DagBuilder {
 public:
  /// A grid of 2^height voxels a side, 2 <= height <= 21.
  DagBuilder(int height, Colors colors, Counts counts, Context& ctx);
  /// Appends voxels; places ascend strictly from call to call and are inside the grid (ErrorCode::internal).
  Status add(std::span<const SurfaceVoxel> voxels);
  /// The DAG; of no voxels it has one leaf word, without any, and no nodes. Call it last.
  Result<Dag> finish();

 private:
  /// A node that still grows.
  struct Open {
    uint32_t mask = 0;
    uint32_t children = 0;
    std::array<uint32_t, 8> pointers;
    std::array<uint64_t, 8> counts;
  };
  struct Closed {
    uint32_t pointer;
    uint64_t colors;
  };
  Status close_leaf();
  Status close_up_to(int height);
  Status append(int height, uint32_t octant, Closed child);
  Result<Closed> close(int height);
  Status check_memory();

  Dag dag_;
  std::vector<Open> open_;  ///< by height
  UniqueRuns<uint64_t> unique_leaves_;
  std::vector<UniqueRuns<uint32_t>> unique_nodes_;  ///< by height
  uint64_t leaf_ = 0;                               ///< the word that grows
  uint64_t leaf_place_ = 0;                         ///< its voxels' places, without the lowest six bits
  uint64_t next_ = 0;                               ///< least place that may come
  Reservation reservation_;
  uint64_t reserved_ = 0;
};

}  // namespace voxkit::color
