// What a ray sees of a compressed surface: where its voxels are, from the DAG alone. Colours are looked up
// afterwards, for what was hit (D. Dolonius et al., TVCG 2019, section 5).
#pragma once

#include <bit>
#include <memory>

#include "libcolor/color.h"
#include "libcolor/dag/dag_view.h"
#include "libcolor/dag/node_parts.h"
#include "librender/cast/grid.h"

namespace voxkit::render {

/// Cells are empty octants and voxels. path: keeps the nodes above the last voxel.
template <Search search>
struct DagCastView {
  const color::DagView* dag;

  class Cursor {
   public:
    VOX_HD_HOT explicit Cursor(const DagCastView& volume) : dag_(*volume.dag), lowest_(dag_.height) {
      pointer(dag_.height) = dag_.root;
      if (dag_.height == color::leaf_height) leaf_ = dag_.leaf(dag_.root);
    }
    /// The value of a cell that is not void is its height, opaque. `finest`: cells of edge 2^finest are fine
    /// enough, at least 2; -1: all detail.
    VOX_HD_HOT Cell locate(uint32_t x, uint32_t y, uint32_t z, int finest) {
      const uint32_t apart = (x ^ x_) | (y ^ y_) | (z ^ z_);
      // Nodes of this height and above are those of the last voxel.
      int h = search == Search::restart ? dag_.height : static_cast<int>(std::bit_width(apart));
      if (h < lowest_) h = lowest_;
      x_ = x;
      y_ = y;
      z_ = z;
      if (search == Search::restart) pointer(h) = dag_.root;
      for (; h > color::leaf_height; --h) {
        lowest_ = h;
        if (h <= finest) return {opaque_cell(h), h};
        const color::NodeRef node = dag_.node(h, pointer(h));
        const int s = h - 1;
        const uint32_t octant = (x >> s & 1) | (y >> s & 1) << 1 | (z >> s & 1) << 2;
        ++nodes_;
        if (!node.there || !node.has(octant)) return {{}, s};
        pointer(s) = dag_.pointer(node, octant);
      }
      if (lowest_ != color::leaf_height) leaf_ = dag_.leaf(pointer(color::leaf_height));
      lowest_ = color::leaf_height;
      const uint64_t leaf = leaf_;
      if (finest >= color::leaf_height && leaf != 0)
        return {opaque_cell(color::leaf_height), color::leaf_height};
      const uint32_t octant = (x >> 1 & 1) | (y & 2) | (z & 2) << 1;
      const auto eight = static_cast<uint32_t>(leaf >> 8 * octant & 0xff);
      if (eight == 0) return {{}, leaf == 0 ? color::leaf_height : 1};
      const uint32_t bit = (x & 1) | (y & 1) << 1 | (z & 1) << 2;
      return {(eight >> bit & 1) != 0 ? opaque_cell(0) : Voxel{}, 0};
    }
    /// Which parts hold voxels of the cell that was located last, coarser than voxels, and not void.
    VOX_HD_HOT uint64_t parts(const Cell& cell) const {
      const int h = cell.log2_edge;
      return h == color::leaf_height ? leaf_
                                     : color::node_parts(dag_, h, pointers_[search == Search::path ? h : 0]);
    }
    /// Nodes entered, and bytes of them looked at.
    VOX_HD_HOT uint32_t blocks() const { return nodes_; }
    VOX_HD_HOT uint32_t bytes() const { return nodes_ * 8; }

   private:
    VOX_HD_HOT static Voxel opaque_cell(int height) {
      return Voxel::of(static_cast<uint32_t>(height) | 0xff000000u);
    }
    /// Of the node of a height, on the path; or of the one that was come to.
    VOX_HD_HOT uint32_t& pointer(int h) { return pointers_[search == Search::path ? h : 0]; }

    const color::DagView& dag_;
    uint32_t
        pointers_[search == Search::path ? color::most_levels + 1 : 1];  ///< by height, down to `lowest_`
    uint32_t x_ = 0, y_ = 0, z_ = 0;
    int lowest_;
    uint64_t leaf_ = 0;  ///< the word, where `lowest_` is its height
    uint32_t nodes_ = 0;
  };
  VOX_HD_HOT Cursor cursor() const { return Cursor(*this); }
};

/// A compressed surface, drawn from its file.
class DagGrid {
 public:
  explicit DagGrid(std::shared_ptr<const color::Volume> volume);
  const VolumeInfo& info() const { return volume_->info(); }
  const color::Volume& volume() const { return *volume_; }
  const LearnedVoid& learned() const { return *learned_; }

 private:
  std::shared_ptr<const color::Volume> volume_;
  std::shared_ptr<const LearnedVoid> learned_;
};

}  // namespace voxkit::render
