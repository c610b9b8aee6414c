// What a ray sees of a packed volume of colours: which voxels are solid, from masks alone. Colours are looked
// up afterwards, for what was hit (thesis section 5.4.4, rendering by proxy).
#pragma once

#include <array>
#include <bit>
#include <memory>

#include "librender/cast/grid.h"
#include "libsvmm/packed/mask_tree.h"

namespace voxkit::render {

/// Cells are cubes without a solid voxel, and voxels. path: keeps the nodes above the last voxel.
template <Search search>
struct MaskCastView {
  const svmm::MaskView* tree;

  class Cursor {
   public:
    VOX_HD_HOT explicit Cursor(const MaskCastView& volume) : tree_(*volume.tree), lowest_(tree_.height) {
      node(tree_.height) = 0;
    }
    /// A solid voxel is opaque. There are no coarser cells than voxels, whatever is `finest`.
    VOX_HD_HOT Cell locate(uint32_t x, uint32_t y, uint32_t z, int finest) {
      (void)finest;
      // Nodes of this height and above are those of the last voxel.
      int h = tree_.height;
      if (search == Search::path) {
        const uint32_t apart = (x ^ x_) | (y ^ y_) | (z ^ z_);
        h = (static_cast<int>(std::bit_width(apart)) + 1) / 2;
        if (h < lowest_) h = lowest_;
        x_ = x;
        y_ = y;
        z_ = z;
      } else {
        node(h) = 0;
      }
      for (; h > 1; --h) {
        lowest_ = h;
        const svmm::MaskNode& here = tree_.nodes[h][node(h)];
        ++nodes_;
        const uint32_t bit = svmm::mask_bit(x, y, z, h);
        if ((here.mask >> bit & 1) == 0) return {{}, void_log2(here.mask, bit, 2 * (h - 1))};
        node(h - 1) = here.child(bit);
      }
      lowest_ = 1;
      const uint64_t word = tree_.words[node(1)];
      const uint32_t bit = svmm::mask_bit(x, y, z, 1);
      if ((word >> bit & 1) == 0) return {{}, void_log2(word, bit, 0)};
      return {Voxel::of(0xff000000u), 0};
    }
    /// Nodes entered, and bytes of them looked at.
    VOX_HD_HOT uint32_t blocks() const { return nodes_; }
    VOX_HD_HOT uint32_t bytes() const { return nodes_ * 16; }

   private:
    /// The edge of a void child, or of the 2^3 that it is one of, if they are all void.
    VOX_HD_HOT static int void_log2(uint64_t mask, uint32_t bit, int log2_edge) {
      constexpr uint64_t eight = 0x330033;
      return log2_edge + ((mask >> (bit & 0b101010) & eight) == 0 ? 1 : 0);
    }
    /// Of the node of a height, on the path; or of the one that was come to.
    VOX_HD_HOT uint32_t& node(int h) { return path_[search == Search::path ? h : 0]; }

    const svmm::MaskView& tree_;
    uint32_t
        path_[search == Search::path ? svmm::MaskView::most_heights : 1];  ///< by height, down to `lowest_`
    uint32_t x_ = 0, y_ = 0, z_ = 0;
    int lowest_;
    uint32_t nodes_ = 0;
  };
  VOX_HD_HOT Cursor cursor() const { return Cursor(*this); }
};

/// Whether no voxel is at lo <= v < hi, a box that is not empty. Enters `budget` nodes and words at most,
/// which it counts down; false where these do not suffice.
class MaskVoidSearch {
 public:
  MaskVoidSearch(const svmm::MaskView& tree, int budget) : tree_(tree), budget_(budget) {}

  bool operator()(const uint32_t (&lo)[3], const uint32_t (&hi)[3]) {
    found_ = false;
    for (size_t a = 0; a < 3; ++a) lo_[a] = lo[a], hi_[a] = hi[a];
    return is_void(tree_.height, 0, {0, 0, 0});
  }
  int budget() const { return budget_; }
  /// Of a box that is not void: whether that is since a voxel was found, and where along an axis it lies,
  /// begin <= v < end.
  bool found() const { return found_; }
  uint64_t begin(int axis) const { return at_[static_cast<size_t>(axis)]; }
  uint64_t end(int axis) const { return begin(axis) + 1; }

 private:
  using Corner = std::array<uint32_t, 3>;
  bool is_void(int h, uint32_t index, const Corner& corner);

  const svmm::MaskView& tree_;
  int budget_;
  std::array<uint32_t, 3> lo_{}, hi_{};
  bool found_ = false;
  Corner at_{};
};

/// A packed volume of colours, drawn from its file.
class MaskGrid {
 public:
  /// Whether rays can go through masks: level 0 is there, and solid voxels of it are opaque.
  static bool fits(const svmm::PackedVolume& volume);
  /// Decodes the masks of a volume that fits. Errors: ErrorCode::input, limit.
  static Result<MaskGrid> open(std::shared_ptr<const svmm::PackedVolume> volume, Context& ctx);
  /// Of RGBA32 whatever the volume is: voxels are void, or opaque.
  const VolumeInfo& info() const { return info_; }
  const svmm::PackedVolume& volume() const { return *volume_; }
  const svmm::MaskTree& tree() const { return *tree_; }
  const LearnedVoid& learned() const { return *learned_; }

 private:
  VolumeInfo info_;
  std::shared_ptr<const svmm::PackedVolume> volume_;
  std::shared_ptr<const svmm::MaskTree> tree_;
  std::shared_ptr<const LearnedVoid> learned_;
};

}  // namespace voxkit::render
