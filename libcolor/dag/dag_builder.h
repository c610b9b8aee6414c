// From voxels in Morton order to a DAG, bottom up, in one pass.
#pragma once

#include <span>
#include <vector>

#include "libcolor/dag/dag_pool.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// Counts are in nodes, of voxels, in Morton order. Memory: the DAG and its hash tables, which count against
/// ctx.memory.
class DagBuilder {
 public:
  /// A grid of 2^height voxels a side, 2 <= height <= 21.
  DagBuilder(int height, Context& ctx);
  /// Appends voxels; places ascend strictly from call to call and are inside the grid (ErrorCode::internal).
  Status add(std::span<const SurfaceVoxel> voxels);
  /// The same of all voxels of a cell of height 2, by its Morton code: a leaf word with at least one.
  Status add_word(uint64_t place, uint64_t word);
  /// The DAG; of no voxels it has one leaf word, without any, and no nodes. Call it last.
  Result<Dag> finish();

 private:
  Status enter_word(uint64_t place);
  Status close_leaf();
  Status close_up_to(int height);
  void append(int height, uint32_t octant, Subtree child);

  DagPool pool_;
  int height_;
  std::vector<Octants> open_;  ///< nodes that still grow, by height
  Subtree root_;
  uint64_t leaf_ = 0;        ///< the word that grows
  uint64_t leaf_place_ = 0;  ///< its voxels' places, without the lowest six bits
  uint64_t next_ = 0;        ///< least place that may come
  uint64_t voxels_ = 0;
};

}  // namespace voxkit::color
